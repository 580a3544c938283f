"""Chaos from outside: real runs whose processes are killed, stopped and signalled at any instant, drawn from seeds.

``python -m tests.chaos`` is the campaign; docs/robustness.md says what it tries, and what must hold.
"""
