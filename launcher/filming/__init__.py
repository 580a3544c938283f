"""What a camera sees, drawn: frames, a video of them, and a sheet with one frame of each shot."""
