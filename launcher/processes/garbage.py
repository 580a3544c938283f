"""How often a program looks for garbage."""

from __future__ import annotations

import gc


def look_seldom() -> None:
    """A program that makes much and drops little (a process that begins, a plan of a large field) finds hardly any.

    With the interpreter's own settings, a run of 100,000 nodes in virtual time spends a third of its time on that.
    """
    gc.set_threshold(20_000, 20, 50)
