"""Straight paths from the closest points of approach that sensors report of an event."""
