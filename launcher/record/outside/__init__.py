"""What the processes of a camera told in a run: collected from their diaries, kept in the run folder, read back."""
