"""How often a program collects garbage."""

from __future__ import annotations

import gc


def look_seldom() -> None:
    """Collect garbage less often: a process that starts, or plans a large field, keeps nearly all that it makes.

    With the interpreter's own settings, a run of 100,000 nodes in virtual time spends a third of its time on it.
    """
    gc.set_threshold(20_000, 20, 50)
