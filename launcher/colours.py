"""The colour of each tracker: the same in the timeline, on every page and in every figure."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Final

PALETTE: Final = (
    *("#e69f00", "#0072b2", "#cc79a7", "#009e73", "#d55e00", "#56b4e9", "#9c755f"),
    *("#7b61c9", "#a8a400", "#e15759", "#1b9aaa", "#5500ff", "#a63d7a", "#6b8e23", "#c49a6c"),
    *("#8b1a1a", "#ff8fab", "#00b300"),
)
"""Okabe and Ito, colours that everybody can tell apart on white and on black, and a brown; then others, of which none
is grey, as the target is."""
_OWN: Final = (
    *("imm-ukf", "spcpf", "bootstrap", "fix-doa", "ekf", "ukf", "predict-only"),
    *("gpf-ukf", "upf", "fa-upf", "upf-paper", "rbpf", "mrbpf", "mrbpf-weightmass", "jm-rbpf"),
    *("cpa", "ecpa", "ml"),
)
"""The packaged trackers, each with the colour at its place."""
_FORMER: Final = {"fix-imm-ukf": "imm-ukf"}
"""Former names, and whose colour they have."""


def tracker_colours(trackers: Sequence[str]) -> dict[str, str]:
    """A colour ("#rrggbb") for each of these trackers.

    A packaged tracker always has its own; any other has the first that is left, and no two have the same as long as
    the palette lasts.
    """
    return dict(_colours(tuple(trackers)))


@lru_cache(maxsize=64)
def _colours(trackers: tuple[str, ...]) -> tuple[tuple[str, str], ...]:
    own = dict(zip(_OWN, PALETTE, strict=True))
    own |= {former: own[now] for former, now in _FORMER.items() if former in trackers and now not in trackers}
    taken = {own[name] for name in trackers if name in own}
    free = [colour for colour in PALETTE if colour not in taken] or list(PALETTE)
    others = [name for name in dict.fromkeys(trackers) if name not in own]
    given = own | {name: free[rank % len(free)] for rank, name in enumerate(others)}
    return tuple((name, given[name]) for name in dict.fromkeys(trackers))
