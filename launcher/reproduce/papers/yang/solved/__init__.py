"""What is computed of the reports or the sound of a pass: paths, what rivals make of it, what it costs."""
