"""Finished runs side by side: as a table, as a page, as data, and in one recording."""
