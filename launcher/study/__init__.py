"""Many runs, and runs of before: studies over seeds, comparisons, the same reports fused again."""
