"""The operating-system processes of a run: forked or gathered, given their places, watched, and ended with the run."""
