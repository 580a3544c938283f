"""The figures of a run: errors, bounds, energy, the channel, hops; and their types."""
