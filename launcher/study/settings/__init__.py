"""Which setting is best: figures of a few settings of one key, compared pair by pair over the same seeds."""
