"""What is run to reproduce a published experiment: a field, a target, and trackers side by side."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from trackfield.filters.trackers import TRACKERS
from trackfield.scenario import Scenario

Options = Mapping[str, Any]


@dataclass(frozen=True)
class Case:
    """One field, one target, and the trackers on it; ``trackers`` maps their names to their options.

    All trackers of a case get the same reports. ``settings`` are dotted keys over ``base``, a packaged scenario or one
    as a mapping.
    """

    name: str
    settings: Mapping[str, Any]
    trackers: Mapping[str, Options]
    base: str | Mapping[str, Any]

    def only(self, *names: str) -> Case:
        """The case with these of its trackers alone: each gets the same random draws as beside all others."""
        return replace(self, trackers={name: self.trackers[name] for name in names})

    def scenario(self, seed: int) -> Scenario:
        """The scenario of one run."""
        overrides = {
            "seed": seed,
            **self.settings,
            "fusion.options": {name: options for name, options in self.trackers.items() if options},
            "fusion.trackers": list(self.trackers),
        }
        return Scenario.load(self.base, overrides, known_trackers=TRACKERS)
