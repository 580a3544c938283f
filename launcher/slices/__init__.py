"""A share of a run's field, started on another host than the launcher's: its router, its processes, their clock."""
