"""Recordings listened to as a sensor would: the passes that are found in them, and a picture of what was found."""
