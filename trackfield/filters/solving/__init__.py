"""Trackers that gather the reports of a target that passes, event by event, and solve for its path at once."""
