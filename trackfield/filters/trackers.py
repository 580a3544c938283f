"""Trackers by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any, Final

from trackfield.errors import ScenarioError
from trackfield.filters.bootstrap import Bootstrap
from trackfield.filters.fix_doa import FixDoa
from trackfield.filters.fix_imm_ukf import FixImmUkf
from trackfield.filters.single_model import Ekf, PredictOnly, Ukf
from trackfield.filters.spcpf import SpCpf
from trackfield.filters.types import Tracker

TRACKERS: Final[Mapping[str, Callable[..., Tracker[Any]]]] = MappingProxyType(
    {
        "fix-imm-ukf": FixImmUkf,
        "spcpf": SpCpf,
        "bootstrap": Bootstrap,
        "fix-doa": FixDoa,
        "ekf": Ekf,
        "ukf": Ukf,
        "predict-only": PredictOnly,
    }
)


def make_tracker(name: str, options: Mapping[str, Any] | None = None) -> Tracker[Any]:
    """The tracker of this name; ``options`` are its fields; ``tracker`` among them says whose variant it is.

    Raises ``ScenarioError`` with the nearest name if there is none, or if it has no such option.
    """
    fields = dict(options or {})
    kind = fields.pop("tracker", name)
    if kind not in TRACKERS:
        near = get_close_matches(kind, TRACKERS, n=1)
        expected = f"'{near[0]}'" if near else "one of " + ", ".join(sorted(TRACKERS))
        raise ScenarioError(f"unknown tracker '{kind}'", expected=expected)
    try:
        return TRACKERS[kind](**fields)
    except (TypeError, ValueError) as error:
        raise ScenarioError(f"tracker '{name}': {error}", key=f"fusion.options.{name}") from None
