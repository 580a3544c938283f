"""The sections of a scenario file that have a single kind."""
