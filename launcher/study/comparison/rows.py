"""The figures of a comparison in groups: a row each, with a cell for each run."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

from launcher.record.figures.verdict import TRACKED, told
from launcher.record.words import span
from launcher.report.cells import NOTHING, number, percent
from launcher.study.comparison.runs import Compared

Cell = float | int | str | None
Better = Literal["lower", "higher"]
OF_ALL: Final = ("sent", "expected", "delivered", "late")
"""Counts of frames that are always shown."""


@dataclass(frozen=True)
class Row:
    """A figure of each run. ``better`` says which is the best, among the cells that ``judged`` names (none: all)."""

    name: str
    cells: tuple[Cell, ...]
    better: Better | None = None
    text: Callable[[Any], str] = number
    judged: tuple[bool, ...] = ()

    @property
    def best(self) -> tuple[bool, ...]:
        """(runs,) whether a cell is the best, if not all read the same; equal ones are all marked."""
        judged = self.judged or (True,) * len(self.cells)
        fair = [
            (float(cell), text)
            for cell, text, ok in zip(self.cells, self.said, judged, strict=True)
            if ok and isinstance(cell, int | float)
        ]
        if not self.better or len({text for _, text in fair}) < 2:
            return (False,) * len(self.cells)
        _, best = min(fair) if self.better == "lower" else max(fair)
        return tuple(ok and text == best for text, ok in zip(self.said, judged, strict=True))

    @property
    def said(self) -> tuple[str, ...]:
        """(runs,) the cells in words."""
        return tuple(_said(cell, self.text) for cell in self.cells)


@dataclass(frozen=True)
class Group:
    """Rows that belong together; a ``tracker``'s have its colour."""

    title: str
    rows: tuple[Row, ...]
    tracker: str = ""


def settings(compared: Compared) -> Group:
    """The keys of the scenarios that are not the same in all runs."""
    rows = (
        Row(key, tuple(None if value is None else setting(value) for value in values))
        for key, values in compared.settings.items()
    )
    return Group("settings that differ", tuple(rows))


def setting(value: Any) -> str:
    """A value of a scenario in words."""
    return value if isinstance(value, str) else json.dumps(value, default=str)


def figures(compared: Compared) -> list[Group]:
    """The figures of the runs; rows that are empty in all runs are left out, except the basic ones."""
    sums: Better | None = "lower" if compared.same_length else None
    groups = [
        *(Group(name, tuple(_tracker(name, compared)), name) for name in compared.trackers),
        Group("bound", tuple(_bounds(compared.metrics))),
        Group("camera", tuple(camera_rows(compared.metrics))),
        Group("frames", tuple(_frames(compared.metrics))),
        Group("network and energy", tuple(_costs(compared.metrics, sums))),
        Group("machine", tuple(_machine(compared.metrics))),
    ]
    return [group for group in groups if group.rows]


def _tracker(name: str, compared: Compared) -> Iterator[Row]:
    """The errors of one tracker, judged only where the verdict is tracked, and if all runs have the same target."""
    found = [metrics["trackers"].get(name) for metrics in compared.metrics]
    tracked = tuple(t is not None and t["verdict"] == TRACKED for t in found)
    lower: Better | None = "lower" if compared.same_target else None

    def row(text: str, *path: str, better: Better | None = None, how: Callable[[Any], str] = number) -> Row:
        return Row(text, tuple(_at(t, path) for t in found), better, how, tracked)

    def pair(text: str, cells: Sequence[Any], words: str) -> Row:
        both = (None if cell is None else words.format(*map(number, cell)) for cell in cells)
        return Row(text, tuple(both))

    yield Row("verdict", tuple(t and told(t) for t in found))
    yield row("RMSE [m]", "rmse", "position", better=lower)
    yield from _telling(row("RMSE / bound", "times_bound", better="lower"))
    yield row("median error [m]", "median_error", better=lower)
    yield from _telling(row("velocity RMSE [m/s]", "rmse", "velocity", better=lower))
    yield pair("steps with a track", [t and (t["steps_tracked"], t["steps_expected"]) for t in found], "{} of {}")
    yield Row("steps within lost_m", tuple(_at(t, ("share_within",)) for t in found), "higher", percent)
    yield Row("longest time without a track [s]", tuple(_at(t, ("longest_blackout_s",)) for t in found), "lower")
    yield from _telling(row("RMSE in gaps of the truth [m]", "gap", "rmse"))
    for text, key in (("NEES", "nees"), ("NEES of the position", "nees_position")):
        bands = [_at(t, (f"{key}_band",)) for t in found]
        yield from _telling(row(f"mean {text}", key), pair(f"{text}, 95 % band", bands, "{} to {}"))


def _bounds(metrics: Sequence[Mapping[str, Any]]) -> list[Row]:
    names = {"trajectory": "with the reports of the run [m]", "position": "with every report in reach [m]"}
    return _telling(*(_row(metrics, text, "bound", key) for key, text in names.items()))


def camera_rows(metrics: Sequence[Mapping[str, Any]]) -> list[Row]:
    """What cameras beyond gateways saw; none where no run has one."""
    if all(one["camera"] is None for one in metrics):
        return []
    seen = ("camera", "in_frame")
    return [
        _row(metrics, "target in the picture at the aim", *seen, "at_aim", better="higher", text=percent),
        _row(metrics, "frames with the target", *seen, "frames", better="higher", text=percent),
        _row(metrics, "shots", "camera", "shots"),
        *_telling(
            _row(metrics, "shots with the target in any frame", *seen, "shots", better="higher", text=percent),
            _row(metrics, "last pass to camera control, mean [s]", "camera", "delay_s", "mean", better="lower"),
            _row(metrics, "turning, mean [s]", "camera", "slew_s", "mean"),
            _row(metrics, "aim to target, mean [m]", "camera", "place_m", "mean", better="lower"),
            _row(metrics, "off in pan at the aim, mean [°]", "camera", "pan_deg", "mean", better="lower"),
            _row(metrics, "camera lost [times]", "camera", "lost", "times", better="lower"),
            _row(metrics, "dropped by the gateway", "camera", "gateway", "dropped", better="lower"),
        ),
    ]


def _frames(metrics: Sequence[Mapping[str, Any]]) -> Iterator[Row]:
    lost = [
        sum(m["frames"]["lost"].values()) + sum(m["frames"][key] or 0 for key in ("host_lost", "host_late"))
        for m in metrics
    ]
    shares = (
        n / m["frames"]["expected"] if m["frames"]["expected"] else None for n, m in zip(lost, metrics, strict=True)
    )
    yield from (_row(metrics, key, "frames", key) for key in OF_ALL)
    yield Row("lost", tuple(lost))
    yield Row("share lost", tuple(shares), "lower", percent)
    causes = dict.fromkeys(cause for m in metrics for cause in m["frames"]["lost"])
    yield from _telling(
        *(_row(metrics, f"lost: {cause.replace('_', ' ')}", "frames", "lost", cause) for cause in causes)
    )
    yield from _telling(
        _row(metrics, "lost by the machine", "frames", "host_lost"),
        _row(metrics, "too late on the machine", "frames", "host_late"),
    )


def _costs(metrics: Sequence[Mapping[str, Any]], sums: Better | None) -> list[Row]:
    return _telling(
        _row(metrics, "payload [bytes]", "bytes", "payload", better=sums),
        _row(metrics, "on the air [bytes]", "bytes", "on_air", better=sums),
        _row(metrics, "on the link, 95 % [ms]", "latency_ms", "link", "p95", better="lower"),
        _row(metrics, "step to track, 95 % [ms]", "latency_ms", "to_track", "p95", better="lower"),
        _row(metrics, "clock error, rms [ms]", "clock_error_ms", "rms", better="lower"),
        _row(metrics, "energy [J]", "energy_j", "total", better=sums),
        _row(metrics, "energy of the node that used most [J]", "energy_j", "max_node", better=sums),
        _row(metrics, "first battery empty after", "lifetime_s", "first_death", better="higher", text=span),
    )


def _machine(metrics: Sequence[Mapping[str, Any]]) -> Iterator[Row]:
    drivers = _row(metrics, "driver", "driver")
    if len(set(drivers.cells)) > 1:
        yield drivers
    yield _row(metrics, "events out of order (host late)", "timing", "host_late")


def _row(
    metrics: Sequence[Mapping[str, Any]],
    name: str,
    *path: str,
    better: Better | None = None,
    text: Callable[[Any], str] = number,
) -> Row:
    return Row(name, tuple(_at(m, path) for m in metrics), better, text)


def _telling(*rows: Row) -> list[Row]:
    return [row for row in rows if any(row.cells)]


def _at(figures: Mapping[str, Any] | None, path: Sequence[str]) -> Any:
    """The figure at this path; None where there is none."""
    found: Any = figures
    for key in path:
        found = (found or {}).get(key)
    return found


def _said(cell: Cell, text: Callable[[Any], str]) -> str:
    return NOTHING if cell is None else cell if isinstance(cell, str) else text(cell)
