"""The picture of a run in Rerun: as a file, live, or as a PNG. Nobody else knows Rerun."""
