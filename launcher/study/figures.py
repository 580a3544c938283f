"""The figures of a run that studies show: keys of metrics.json, with their names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

from trackfield.errors import ScenarioError
from trackfield.scenario.nearest import suggestion

Better = Literal["less", "more"]
LOST: Final = "frames.lost"
"""Frames lost for any cause: the sum of what metrics.json has below this key."""


@dataclass(frozen=True)
class Figure:
    """A figure: its key in metrics.json (of a tracker: below its name), what it is called, and which is better."""

    key: str
    name: str
    unit: str
    better: Better = "less"

    @property
    def title(self) -> str:
        """Its name with its unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def of(self, row: Mapping[str, Any]) -> float | None:
        """Its value in a row of a study's table."""
        if self.key == LOST:
            return float(sum(value for key, value in row.items() if key.startswith(f"{LOST}.")))
        value = row[self.key]
        return None if value is None else float(value)


FIGURES: Final = {
    figure.key: figure
    for figure in (
        Figure("rmse.position", "RMSE", "m"),
        Figure("rmse.velocity", "RMSE of the velocity", "m/s"),
        Figure("median_error", "median error", "m"),
        Figure("share_within", "share of steps with the track within lost_m", "", "more"),
        Figure("longest_blackout_s", "longest blackout", "s"),
        Figure("times_bound", "RMSE / bound", ""),
        Figure("latency_ms.link.p95", "latency on the link, 95 %", "ms"),
        Figure("latency_ms.to_track.p95", "latency from step to track, 95 %", "ms"),
        Figure("energy_j.total", "energy", "J"),
        Figure("energy_j.max_node", "energy of the node that used most", "J"),
        Figure("lifetime_s.first_death", "first battery empty", "s", "more"),
        Figure("lifetime_s.half_dead", "half of the batteries empty", "s", "more"),
        Figure("lifetime_s.coverage_lost", "coverage lost", "s", "more"),
        Figure("frames.sent", "frames sent", ""),
        Figure(LOST, "frames lost", ""),
        Figure("bytes.payload", "payload", "bytes"),
        Figure("bytes.on_air", "bytes on the air", "bytes"),
        Figure("base.rmse.position", "RMSE at the base", "m"),
        Figure("base.share_within", "share of steps tracked at the base", "", "more"),
        Figure("base.detection_s", "detection delay at the base", "s"),
        Figure("network.rmse.position", "RMSE in the network", "m"),
        Figure("latency_ms.to_base.p95", "latency from step to base, 95 %", "ms"),
        Figure("age_of_information_s.base_mean", "age of what the base knows", "s"),
        Figure("ledger.present.bytes", "bytes sent with a target", "bytes"),
        Figure("ledger.setup.total_j", "energy of the set-up", "J"),
        Figure("ledger.power_w.present", "power with a target", "W"),
        Figure("ledger.power_w.idle", "power without a target", "W"),
        Figure("ledger.hottest", "hottest node / mean", ""),
        Figure("ledger.lifetime_s.first_death", "first battery empty, target 1 % of the time", "s", "more"),
        Figure("ledger.lifetime_s.half_dead", "half of the batteries empty, target 1 % of the time", "s", "more"),
        Figure("channel.use_peak", "peak channel use", ""),
        Figure("passes.fixes_per_pass", "fixes per pass", "", "more"),
        Figure("passes.location_m.mean", "error of fixes, place", "m"),
        Figure("passes.speed_m_s.mean", "error of fixes, speed", "m/s"),
        Figure("passes.delay_s.mean", "delay of fixes", "s"),
        Figure("camera.in_frame.at_aim", "targets in the picture at the aim", "", "more"),
        Figure("camera.in_frame.frames", "frames with the target", "", "more"),
        Figure("camera.in_frame.shots", "shots with the target in any frame", "", "more"),
        Figure("camera.delay_s.mean", "delay of fixes at the camera", "s"),
        Figure("camera.place_m.mean", "error of where the camera aims", "m"),
        Figure("camera.gateway.dropped", "items dropped by the gateway", ""),
    )
}
"""By their keys."""
COST: Final = ("energy_j.total", "bytes.on_air", "frames.sent")
"""What a field costs, the most meaningful first."""
ERROR: Final = "rmse.position"
LIFE: Final = "ledger.lifetime_s.first_death"
BASE_ERROR: Final = "base.rmse.position"

_SCALES: Final = {
    "s": ((172_800.0, 86_400.0, "days"), (7_200.0, 3_600.0, "h"), (0.0, 1.0, "s")),
    "W": ((0.1, 1.0, "W"), (0.0, 1e-3, "mW")),
    "J": ((1e4, 1e3, "kJ"), (0.1, 1.0, "J"), (0.0, 1e-3, "mJ")),
}
"""(least largest value, factor, unit) of each unit that large or small values are shown in."""


def scale_of(unit: str, values: Sequence[float]) -> tuple[float, str]:
    """(factor, unit) in which such values are shown."""
    most = max(values, default=0.0)
    return next(((by, to) for least, by, to in _SCALES.get(unit, ()) if most >= least), (1.0, unit))


def pair(text: str) -> tuple[str, str]:
    """``X,Y`` as two keys of figures. Raises ``ScenarioError`` for any other text, under the key ``--pareto``."""
    keys = [part.strip() for part in text.split(",")]
    for key in keys:
        check_figure(key, "--pareto")
    if len(keys) != 2 or keys[0] == keys[1]:
        raise ScenarioError(f"is {text!r}", key="--pareto", expected="two figures, like energy_j.total,rmse.position")
    return keys[0], keys[1]


def check_figure(figure: str, key: str) -> None:
    """Raise ``ScenarioError`` under this key if there is no such figure."""
    if figure not in FIGURES:
        what = f"there is no figure {figure!r}{suggestion(figure, FIGURES)}"
        raise ScenarioError(what, key=key, expected=f"one of {', '.join(FIGURES)}")
