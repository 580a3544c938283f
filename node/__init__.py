"""The sensor node."""
