"""A process's battery: when it is empty, and when its charge is reported. Pure functions of a ``Life``."""

from __future__ import annotations

from typing import Final

from trackfield.drivers.engine.conditions import Conditions
from trackfield.drivers.engine.frames import Charge
from trackfield.drivers.engine.life import Life

STEP: Final = 10
"""Per cent."""


def empty(life: Life, given: Conditions) -> bool:
    """Whether the battery is empty."""
    return life.meter.left_fj(given.powers) == 0


def falls_ns(life: Life, given: Conditions) -> int | None:
    """When the battery is empty, or down to the next tenth of its capacity, if nothing else happens; None: never.

    So even a process that sleeps all the time reports its charge now and then.
    """
    capacity = given.battery_fj
    if capacity is None:
        return None
    tenth = (life.told - 1) // STEP * STEP
    return life.meter.falls_ns(given.powers, max(capacity * tenth // 100, 0))


def tell(life: Life, given: Conditions) -> tuple[Life, Charge | None]:
    """The remaining charge, to be reported whenever it has fallen by a per cent."""
    capacity = given.battery_fj
    left = life.meter.left_fj(given.powers) if capacity else None
    if left is None or not capacity:
        return life, None
    percent = -(-100 * left // capacity)
    return (life._replace(told=percent), Charge(percent / 100)) if percent < life.told else (life, None)
