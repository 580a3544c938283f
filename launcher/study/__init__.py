"""Many runs, and finished runs: studies over seeds, comparisons, replays of recorded reports."""
