"""The setups of the sweeps and of what the paper compares: what changes from one case to the next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from launcher.reproduce.papers.yang.trials.field import SPEED, Setup

USUAL: Final = Setup()
"""30 mph, times of sd 0.1 s, strengths of 10 %, places as told."""
STEEP: Final = 3.3
"""The power of the speed with which times have to become more exact, for errors to fall as published (fig. 14)."""
LAWS: Final[Mapping[str, float]] = {"velocity": STEEP, "constant": 0.0, "width": 1.0}
"""How the error of a time falls with speed: as for fig. 14, not at all, as the width d / v of a pulse does."""
SPEEDS: Final = (12.0, SPEED, 16.0, 20.0, 25.0, 30.0)
PLACES: Final = (0.1, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0)
RADII: Final = (10.0, 15.0, 20.0, 25.0, 30.0, 35.0)
NODES: Final = (4, 5, 6, 8)
SILENT: Final = (1, 2)
"""Of five nodes."""
CLOCKS: Final = (0.0, 0.003, 0.01, 0.1)
SPREAD: Final = Setup(p=1.0)
"""Times that are less exact at nodes that are farther away, for the area."""
HULL: Final = 2.378
"""The area of a regular pentagon whose corners are at distance 1."""


def speed_case(law: str, speed: float) -> str:
    """The name of a case of the sweep over speeds."""
    return f"{law} {speed:.3g} m/s"


def place_case(most_m: float) -> str:
    """That of places which are wrong by up to so much."""
    return f"places {most_m:g} m"


def area_case(radius_m: float) -> str:
    """That of nodes on a circle of so large a radius."""
    return f"radius {radius_m:g} m"


def nodes_case(nodes: int) -> str:
    """That of so many nodes."""
    return f"{nodes} nodes"


def silent_case(silent: int) -> str:
    """That of five nodes of which so many do not report."""
    return f"5 nodes, {silent} silent"


def clock_case(sd_s: float) -> str:
    """That of clocks with such an error."""
    return f"clocks {1000 * sd_s:g} ms"


SWEEPS: Final[Mapping[str, Setup]] = {
    **{speed_case(law, v): replace(USUAL, speed=v, q=q) for law, q in LAWS.items() for v in SPEEDS},
    **{place_case(most): replace(USUAL, place_m=most) for most in PLACES},
    **{area_case(radius): replace(SPREAD, radius_m=radius) for radius in RADII},
    **{nodes_case(nodes): replace(USUAL, nodes=nodes) for nodes in NODES},
    **{silent_case(silent): replace(USUAL, silent=silent) for silent in SILENT},
    **{clock_case(sd): replace(USUAL, clock_s=sd) for sd in CLOCKS},
}
"""All cases by name."""
FAIL: Final[Mapping[str, Setup]] = {
    "exact": replace(USUAL, time_s=0.0, strength=0.0),
    "times 0.01 s": replace(USUAL, time_s=0.01),
    "times 0.03 s": replace(USUAL, time_s=0.03),
    "times 0.1 s": USUAL,
    "times 0.1 s, places 5 m": replace(USUAL, place_m=5.0),
}
"""Those in which the original algorithm is beside the enhanced one."""
