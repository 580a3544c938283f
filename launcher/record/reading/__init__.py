"""Run folders read back: which columns and values they have, and whole files of this version only."""
