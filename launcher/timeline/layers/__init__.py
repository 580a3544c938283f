"""What is drawn on top of each other, one layer per sensing kind or role."""
