"""Fields whose sensors hear targets pass: which passes give a fix, and what is sent for that."""
