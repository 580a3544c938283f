"""The commands of ``trackfield``: a file for each, or for a few that belong together."""
