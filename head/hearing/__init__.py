"""Heads of clusters that hear targets pass: interests, reports of closest points of approach, fixes (``role``)."""
