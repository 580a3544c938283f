"""Figures of a camera beyond a gateway: its shots beside the truth."""
