"""What is predicted of a run before it starts, and when that is a warning."""
