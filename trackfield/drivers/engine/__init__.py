"""The engine of both drivers: a role with battery, radio and faults, its events in order, and going back in them."""
