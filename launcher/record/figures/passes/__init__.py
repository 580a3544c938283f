"""Events in a field whose sensors hear targets pass: how each ended, and how far its fix was off."""
