"""The timeline of a run in Rerun: as a file, live, or as a PNG. No other package imports Rerun."""
