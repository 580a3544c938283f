"""Who tracks, and how word gets there: from a surveyed field to processes, one architecture a file."""
