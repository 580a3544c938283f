"""How much a run costs, and how that grows with the field."""
