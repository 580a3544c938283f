"""The papers that are done again, a folder for each: cases, bands, claims, figures."""
