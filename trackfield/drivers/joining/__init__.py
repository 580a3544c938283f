"""How a process finds its run and its place in it, and what it takes over there."""
