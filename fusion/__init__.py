"""The fusion centre."""
