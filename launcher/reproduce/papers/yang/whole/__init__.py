"""Whole runs of ``yang-ecpa``: sound, radio, heads and the base."""
