"""The layers of the field's view: truth, tracks, bearings, close-ups."""
