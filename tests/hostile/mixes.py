"""All that is tried, and what is put together for one attack."""

from __future__ import annotations

from random import Random
from typing import Final

from tests.hostile import frames, orders, tellings
from tests.hostile.attack import Attack
from tests.hostile.samples import ALL, REFUSED, Bad

PLANES: Final = (frames.DATA, orders.CONTROL, orders.LIVE, tellings.TELEMETRY)
HARMLESS: Final = tuple(bad for bad in ALL.values() if bad.follows == REFUSED)
"""What may neither change a run nor end it with another exit code than 0 or 1."""
OTHERS: Final = tuple(bad for bad in ALL.values() if bad.follows != REFUSED)
"""What may change a run that says so, or must raise the alarm."""
SCENARIO_SEEDS: Final = 3
"""How many runs are attacked in turn."""


def attack(seed: int) -> Attack:
    """The attack of a seed: every second one has nothing in it that could change a track."""
    draw = Random(seed)
    mix = draw.sample(HARMLESS, draw.randint(3, len(HARMLESS)))
    if seed % 2:
        mix += draw.sample(OTHERS, draw.randint(1, 3))
    return Attack(mix, seed, draw.randint(1, SCENARIO_SEEDS), draw.choice([20.0, 100.0, 400.0]))


def only(*names: str, seed: int = 1) -> Attack:
    """An attack with nothing but these."""
    return Attack([ALL[name] for name in names], seed)


def of_planes() -> dict[str, tuple[Bad, ...]]:
    """What is tried, by plane."""
    return {plane: tuple(bad for bad in ALL.values() if bad.plane == plane) for plane in PLANES}
