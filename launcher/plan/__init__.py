"""From a scenario to processes: their places, planned faults, hardware and radio links."""
