"""From a scenario to processes: who is there, what befalls them, what they run on, how their radio carries."""
