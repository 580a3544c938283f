"""Published results, done again: ``trackfield reproduce PAPER``."""
