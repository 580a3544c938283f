"""Models fitted to measurements, as fragments of scenarios: a kind of measurement is a file here."""
