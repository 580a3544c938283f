"""Kinds of sensing, one file each: how a reading is made, what it says of a target, how it travels."""
