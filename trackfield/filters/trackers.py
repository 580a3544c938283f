"""Trackers by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any, Final

from trackfield.errors import ScenarioError
from trackfield.filters.bootstrap import Bootstrap
from trackfield.filters.fix_imm_ukf import FixImmUkf
from trackfield.filters.spcpf import SpCpf
from trackfield.filters.types import Tracker

TRACKERS: Final[Mapping[str, Callable[[], Tracker[Any]]]] = MappingProxyType(
    {"spcpf": SpCpf, "fix-imm-ukf": FixImmUkf, "bootstrap": Bootstrap}
)


def make_tracker(name: str) -> Tracker[Any]:
    """The tracker of this name. Raises ``ScenarioError`` with the nearest name if there is none."""
    if name not in TRACKERS:
        near = get_close_matches(name, TRACKERS, n=1)
        expected = f"'{near[0]}'" if near else "one of " + ", ".join(sorted(TRACKERS))
        raise ScenarioError(f"unknown tracker '{name}'", expected=expected)
    return TRACKERS[name]()
