"""The physics, each formula once: the world simulates with it, the filters estimate with it."""
