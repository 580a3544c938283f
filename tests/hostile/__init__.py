"""A hostile peer at the router of a run: bad samples for each key and plane, drawn from seeds.

``field`` is the run that it attacks, ``verdicts`` says what must hold all the same.

``python -m tests.hostile`` is the campaign; docs/robustness.md says what it tries.
"""
