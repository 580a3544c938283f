"""The sections of a scenario file that come in one kind each."""
