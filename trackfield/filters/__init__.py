"""Estimation: one algorithm per file, pure functions over immutable values."""
