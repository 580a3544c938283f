"""The colour of each tracker: the same in the timeline, on every page and in every figure."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Final

PALETTE: Final = ("#e69f00", "#0072b2", "#cc79a7", "#009e73", "#d55e00", "#56b4e9", "#9c755f")
"""Okabe and Ito, colours that everybody can tell apart on white and on black, and a brown."""
_OWN: Final = ("fix-imm-ukf", "spcpf", "bootstrap", "fix-doa", "ekf", "ukf", "predict-only")
"""The packaged trackers, each with the colour at its place."""


def tracker_colours(trackers: Sequence[str]) -> dict[str, str]:
    """A colour ("#rrggbb") for each of these trackers.

    A packaged tracker always has its own; any other has the first that is left, and no two have the same as long as
    the palette lasts.
    """
    return dict(_colours(tuple(trackers)))


@lru_cache(maxsize=64)
def _colours(trackers: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    own = dict(zip(_OWN, PALETTE, strict=True))
    free = [colour for name, colour in own.items() if name not in trackers] or list(PALETTE)
    others = [name for name in dict.fromkeys(trackers) if name not in own]
    given = own | {name: free[rank % len(free)] for rank, name in enumerate(others)}
    return tuple((name, given[name]) for name in dict.fromkeys(trackers))
