"""What is predicted of masters and slaves."""
