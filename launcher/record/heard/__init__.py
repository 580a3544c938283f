"""The events of a run in which sensors hear targets pass: their reports, how they ended, and what was to be heard."""
