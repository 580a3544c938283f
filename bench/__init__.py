"""The cost of a run, and its growth with the field."""
