"""What fits of all kinds of sensing have in common: parameters from some reports, and what is left of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from launcher.calibrate.fragment import Fragment, rounded
from launcher.calibrate.intervals import Blocks, Fitted
from launcher.calibrate.reports import Reports
from launcher.calibrate.samples import Floats
from trackfield.errors import ScenarioError
from trackfield.scenario.sensors import SENSORS


@dataclass(frozen=True)
class SensorFit:
    """A kind fitted to ``reports``: keys of ``[sensor]`` that were ``fitted`` or ``assumed``, why others are ``left``.

    ``own`` is the key of what is a sensor's own, and its values by sensor. ``residual`` (R,) is what the fit leaves of
    each report, in ``unit``; intervals are from ``blocks``; ``notes`` say what the fit does without, or left out.
    """

    kind: str
    reports: Reports
    fitted: Mapping[str, Fitted]
    assumed: Mapping[str, Any]
    left: Mapping[str, str]
    own: tuple[str, Mapping[str, Fitted]]
    residual: Floats
    unit: str
    blocks: Blocks
    notes: tuple[str, ...] = ()

    @property
    def section(self) -> dict[str, Any]:
        """The keys of the section, rounded as they are written, without those by sensor."""
        values = {key: rounded(one.value) for key, one in self.fitted.items()}
        return {"kind": self.kind, **self.assumed, **values}

    def fragment(self, sensors: Path) -> Fragment:
        """The section ``[sensor]``. Raises ``ScenarioError`` if no scenario can have it."""
        name, table = self.own
        own = {id: rounded(one.value) for id, one in table.items()}
        files = ", ".join(self.reports.files)
        try:
            SENSORS[self.kind].model_validate(self.section | {name: own})
        except ValidationError as error:
            key = ".".join(map(str, error.errors()[0]["loc"]))
            value = self.section.get(key, own)
            what = f"fits only with sensor.{key} = {value}, which no scenario can have"
            expected = "reports of sensors of this kind, of a target at different distances"
            raise ScenarioError(what, file=files, expected=expected) from None
        about = [
            f"Fitted to {files} with {sensors.name} by trackfield calibrate {self.kind}.",
            "In comments, 95 % intervals: the jackknife over "
            f"{int(self.blocks.of.max()) + 1} blocks of {self.blocks.length_s:.1f} s.",
            *filter(None, self.notes),
        ]
        return Fragment("sensor", self.section, self.fitted, self.left, about, {name: table})


def own_table(reports: Reports, blocks: Blocks, values: Sequence[Fitted]) -> dict[str, Fitted]:
    """The values by sensor; how precise one is whose reports are all in one block, no block can say."""
    found = {}
    for number, (id, one) in enumerate(zip(reports.ids, values, strict=True)):
        spread = np.ptp(blocks.of[reports.sensor == number]) > 0
        found[id] = one if spread else Fitted(one.value, -inf, inf)
    return found
