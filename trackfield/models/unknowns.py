"""What a kind of sensing depends on besides the target's position and velocity, such as how loud the target is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Unknown:
    """A number that trackers estimate beside (x, y, vx, vy): at first N(``mean``, ``sd``^2), then a random walk.

    Over t seconds the walk's standard deviation is ``walk_sd`` sqrt(t).
    """

    name: str
    sd: float
    walk_sd: float = 0.0
    mean: float = 0.0
