"""Protocol pieces: pure sub-machines that roles are put together from."""
