"""Published results, reproduced: ``trackfield reproduce PAPER``."""
