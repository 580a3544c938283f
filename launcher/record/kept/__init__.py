"""What of a run is on disk before its tables are, and the tables made from it if the recorder dies."""
