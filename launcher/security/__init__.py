"""A run that trusts nobody: its authority, the certificates of its processes, and what each may do at the router."""
