"""The parts of a report, one per topic: its figures, its tables, its words."""
