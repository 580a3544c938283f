"""Draws of one seed."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Any, Final, TypeVar

T = TypeVar("T")


class Draw(Random):
    """Draws of one seed; rounded, so that a scenario can be read and written."""

    def number(self, low: float, high: float) -> float:
        return round(self.uniform(low, high), 3)

    def maybe(self, share: float, make: Callable[[], T]) -> list[T]:
        return [make()] if self.random() < share else []


LINKS: Final[dict[str, Callable[[Draw], dict[str, Any]]]] = {
    "ideal": lambda draw: {"model": "ideal"},
    "fixed": lambda draw: {"model": "fixed", "loss": draw.number(0, 0.5), "delay_ms": draw.number(1, 1500)},
    "bursts": lambda draw: {
        "model": "gilbert_elliott",
        "good_s": draw.number(1, 20),
        "bad_s": draw.number(0.5, 5),
        "delay_ms": draw.number(1, 50),
        "jitter_ms": draw.number(0, 200),
    },
    "radio": lambda draw: {
        "model": "lognormal_prr",
        "radio": draw.choice(["802154-0dbm", "802154-20dbm", "wifi11b", "mica2"]),
        "ack": draw.choice([0, 1, 3]),
        "busy": draw.number(0, 0.6),
        "queue": draw.choice([1, 4, 32]),
    },
    "csma": lambda draw: {
        "model": "csma154",
        "busy": draw.number(0, 0.8),
        "ack": draw.choice([0, 4]),
        "queue": draw.choice([1, 32]),
    },
    "lora": lambda draw: {"model": "lognormal_prr", "radio": "lora868", "sf": draw.randint(7, 10)},
}
