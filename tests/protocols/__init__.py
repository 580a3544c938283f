"""Small protocols whose peers answer each other within milliseconds: what retraction is for.

Each is a role or two of the kind of ``tests.toys``: every message changes a chain, and every message carries one, so
that a wrong order of events anywhere shows in all that follows. Each module has a ``party``: a run and its processes.
"""
