"""Estimation: one algorithm a file, pure functions over values that nobody writes into."""
