"""A process's battery: when it is empty, and what there is to tell of it. Pure functions of a ``Life``."""

from __future__ import annotations

from typing import Final

from trackfield.drivers.conditions import Conditions
from trackfield.drivers.frames import Charge
from trackfield.drivers.life import Life

STEP: Final = 10
"""Per cent."""


def empty(life: Life, given: Conditions) -> bool:
    """Whether there is nothing left in it."""
    return life.meter.left_fj(given.power) == 0


def falls_ns(life: Life, given: Conditions) -> int | None:
    """When it is empty, or down to the next tenth of its capacity, if nothing else happens; None: never.

    So even one who sleeps all the time tells now and then what is left.
    """
    capacity = given.power.battery_fj
    if capacity is None:
        return None
    tenth = (life.told - 1) // STEP * STEP
    return life.meter.falls_ns(given.power, max(capacity * tenth // 100, 0))


def tell(life: Life, given: Conditions) -> tuple[Life, Charge | None]:
    """What is left in it, to be told whenever that is a per cent less."""
    capacity, left = given.power.battery_fj, life.meter.left_fj(given.power)
    if left is None or not capacity:
        return life, None
    percent = -(-100 * left // capacity)
    return (life._replace(told=percent), Charge(percent / 100)) if percent < life.told else (life, None)
