"""What others than the processes of a run did in it, as far as its launcher sees it."""

from __future__ import annotations

from collections import Counter
from threading import Lock
from typing import Final

ORDERS: Final = "orders"
"""Orders that the launcher did not give."""
ANSWERS: Final = "answers"
"""Answers in the launcher's place."""
TOKENS: Final = "tokens"
"""Liveliness tokens of no process of the run, or of a second one in a place, or of a second launcher."""
QUESTIONS: Final = "questions"
"""Questions without the seal of the run."""


class Alarms:
    """How often each happened; any thread may raise one."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self._lock = Lock()

    def add(self, kind: str) -> None:
        """It happened once more."""
        with self._lock:
            self.counts[kind] += 1
