"""How often the camera has the target in its picture: trials and whole runs, beside the prototype and the bands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yang.camera import whole
from launcher.reproduce.papers.yang.camera.aimed import (
    ANY,
    DELAYS,
    EXACT,
    FAR,
    FAST,
    LINES,
    NEAR,
    NOWHERE,
    VIEWS,
    camera_case,
)
from launcher.reproduce.papers.yang.scores import mean_error, share_of
from launcher.reproduce.papers.yang.trials.field import SPEED
from launcher.reproduce.papers.yang.whole.roles import DIRECTIONS, TABLE_1
from launcher.reproduce.tables import Band, Row, aligned, inside, percent, plain, rows_table, with_interval
from trackfield.filters.types import Array

TITLES: Final = {
    "camera": "The camera: targets in its picture, over the delay from the last CPA until control has the fix",
    "camera, roles": "The camera with roles, from sound to its picture",
    "camera, table 1": "Table 1 with the camera: passes of seeds 1 and 2",
}
"""Of the parts of the report."""
TOLD: Final = (0.1, 0.5, 1.0, 2.0)
"""The delays (s) of the tables."""
AT_S: Final = 1.0
"""The delay of the bands."""
SEEN, LOST = Band(0.95, 1.0), Band(0.0, 0.2)
"""In the picture at that delay, with prediction and without: 30 mph, from (30, -25)."""
END_SEEN, END_LOST, END_FAST = Band(0.9, 1.0), Band(0.0, 0.1), Band(0.6, 1.0)
"""The same from sound to the picture, at the delay that is measured; and at 30 m/s with prediction."""
PROTOTYPE: Final[Mapping[tuple[str, str, float], tuple[float, ...]]] = {
    ("with", FAR, SPEED): (1.0, 1.0, 1.0, 1.0),
    ("with", FAR, FAST): (1.0, 1.0, 0.99, 0.91),
    ("with", NEAR, SPEED): (0.99, 0.99, 0.99, 0.95),
    ("with", NEAR, FAST): (0.98, 0.86, 0.75, 0.65),
    ("without", NEAR, SPEED): (0.99, 0.93, 0.06, 0.0),
}
"""At ``TOLD``; along which lines, and where its camera looked at pan 0, is not known."""
COMPARED: Final = ("A to C", ANY)
"""The lines beside which it stands."""
WAYS: Final = {"with": "with prediction", "without": "without"}
_REACH: Final = "out of reach"
_IN_FRAME: Final = "in the picture"


def tables(found: Found) -> dict[str, list[Row]]:
    """All tables, by name; without roles only the first."""
    every = {"camera": [row for case in _cases() for row in _rows(found, *case)]}
    if whole.done(found):
        every["camera, roles"] = [row for name in whole.EXPERIMENTS for row in _whole(found, name)]
        every["camera, table 1"] = table_1_rows(found)
    return every


def share_seen(found: Found, case: str, way: str, view: str, delay: float) -> Interval:
    """The share of the trials with a fix in which the target is in the picture."""
    return _share(_column(found, case, way, view, delay), 1.0)


def _column(found: Found, case: str, way: str, view: str, delay: float) -> Array:
    """Of the trials with a fix."""
    some = found.figures[case][f"{way} {view}"][:, DELAYS.index(delay)]
    return np.asarray(some[~np.isnan(some)])


def _share(some: Array, value: float) -> Interval:
    return share_of(some == value) if some.size else Interval(np.nan, None, None)


def _cases() -> Iterator[tuple[str, float, str]]:
    """Line, speed and camera of what is in the table: exact fixes from one camera only."""
    for line in (*LINES, *(one + EXACT for one in COMPARED)):
        for speed in (SPEED, FAST):
            for view in (NEAR,) if line.endswith(EXACT) else VIEWS:
                yield line, speed, view


def _rows(found: Found, line: str, speed: float, view: str) -> Iterator[Row]:
    case = camera_case(line, speed)
    for way, told in WAYS.items():
        prototype = PROTOTYPE.get((way, view, speed)) if line in COMPARED else None
        for number, delay in enumerate(TOLD):
            ours = share_seen(found, case, way, view, delay)
            banded = delay == AT_S and speed == SPEED and view == NEAR and line in COMPARED
            band = (SEEN if way == "with" else LOST) if banded else None
            yield Row(
                *(case, f"{view}, {told}", f"{_IN_FRAME}, {delay:g} s", ours),
                prototype=None if prototype is None else prototype[number],
                band="" if band is None else str(band),
                verdict="" if band is None else inside([ours], [band]),
            )
            if way == "with":
                away = _share(_column(found, case, way, view, delay), NOWHERE)
                yield Row(case, f"{view}, {_REACH}", f"{_IN_FRAME}, {delay:g} s", away)


def passes(found: Found, name: str, direction: int | None = None) -> Array:
    """``seen`` of all passes of whole runs, or of those in one direction, without their order; NaN: no fix."""
    seen = found.figures[name]["seen"]
    return np.asarray((seen if direction is None else seen[:, direction]).ravel())


def share_of_passes(found: Found, name: str) -> Interval:
    """The share of all passes in which the target is in the picture; each is taken as independent of the others."""
    return share_of(passes(found, name) == 1.0)


BANDS: Final = {
    whole.WITH: END_SEEN, whole.WITHOUT: END_LOST, whole.FASTER: END_FAST, whole.FASTER_ACROSS: END_FAST,
    whole.TWICE: END_SEEN,
}  # fmt: skip


def _whole(found: Found, name: str) -> Iterator[Row]:
    case, view, band = name.removeprefix(whole.RUN), whole.view_of(name), BANDS.get(name)
    ours = share_of_passes(found, name)
    yield Row(
        *(case, view, f"{_IN_FRAME}, share of passes", ours),
        band="" if band is None else str(band),
        verdict="" if band is None else inside([ours], [band]),
    )
    yield Row(case, view, f"{_REACH}, share of passes", share_of(passes(found, name) == NOWHERE))
    figures = found.figures[name]
    yield Row(case, view, "in a frame of the video, share of passes", share_of(figures["filmed"].ravel() == 1.0))
    yield Row(case, view, "control has the fix after the last CPA, s", mean_error(figures["delay"]))
    yield Row(case, view, "the camera has turned after that, s", mean_error(figures["after"]))
    yield Row(case, view, "it looks past the target by, deg", mean_error(figures["off"]))


def table_1_rows(found: Found) -> list[Row]:
    """The eight runs of the field: of each direction the passes of the first two seeds, from two cameras."""
    seen = dict.fromkeys(DIRECTIONS, 0)
    rows = []
    for number, tested in enumerate(TABLE_1, 1):
        seed, direction = seen[tested.direction], DIRECTIONS.index(tested.direction)
        seen[tested.direction] += 1
        for name in (whole.PACKAGED, whole.ALL_FAR):
            figures = found.figures[name]
            if seed < len(figures["seen"]):
                for quantity in ("seen", "delay", "off"):
                    value = float(figures[quantity][seed, direction])
                    if not np.isnan(value):
                        ours = Interval(value, value, value)
                        rows.append(Row(f"{number} {tested.direction}", whole.view_of(name), quantity, ours))
    return rows


def parts(found: Found) -> list[tuple[str, str]]:
    """All tables, with their headings."""
    return [(TITLES[name], text(name, rows)) for name, rows in tables(found).items()]


def text(name: str, rows: Sequence[Row]) -> str:
    """The table of this name, in Markdown."""
    return {"camera": _by_delay, "camera, table 1": _table_1}.get(name, rows_table)(rows)


def _by_delay(rows: Sequence[Row]) -> str:
    """A line for each case and camera: with prediction, how often that is impossible (if it is), and without.

    Cases in which the target always is in the picture are only named, below.
    """
    cases: dict[tuple[str, str], dict[str, list[Row]]] = {}
    for row in rows:
        camera, told = row.tracker.rsplit(", ", 1)
        cases.setdefault((row.case.removeprefix("camera: "), camera), {}).setdefault(told, []).append(row)
    body, always = [], list[str]()
    for (case, camera), some in cases.items():
        if all(row.ours.value == 1.0 for way in WAYS.values() for row in some[way]):
            always.append(f"{case} from {camera}")
            continue
        lines = [one for told, one in some.items() if told != _REACH or any(row.ours.value for row in one)]
        body += [_line(case, one) for one in lines]
    header = ("line", "camera", *(f"{delay:g} s" for delay in TOLD), "prototype", "band", "verdict")
    left_out = f"In the picture in all trials, with and without prediction: {'; '.join(always)}." if always else ""
    return "\n\n".join(one for one in (aligned(header, body), left_out) if one)


def _line(case: str, rows: Sequence[Row]) -> list[str]:
    prototype = [row.prototype for row in rows if row.prototype is not None]
    return [
        *(case, rows[0].tracker),
        *(with_interval(row.ours, percent) for row in rows),
        " / ".join(f"{value:.0%}" for value in prototype) or "-",
        *(next((getattr(row, name) for row in rows if row.band), "") for name in ("band", "verdict")),
    ]


def _table_1(rows: Sequence[Row]) -> str:
    """A line for each run: of both cameras whether it has the target, the delay, and how far it looks past it."""
    runs: dict[str, dict[tuple[str, str], float]] = {
        f"{number} {one.direction}": {} for number, one in enumerate(TABLE_1, 1)
    }
    for row in rows:
        runs[row.case][row.tracker, row.quantity] = row.ours.value
    body = [[run, *(_told(some, view) for view in (NEAR, FAR))] for run, some in runs.items()]
    return aligned(("run", *(f"from {view}: {_IN_FRAME}, delay s / off by deg" for view in (NEAR, FAR))), body)


def _told(some: Mapping[tuple[str, str], float], view: str) -> str:
    seen = some.get((view, "seen"))
    if seen is None:
        return "no fix"
    delay = plain(some[view, "delay"])
    if seen == NOWHERE:
        return f"{_REACH}, {delay}"
    return f"{'yes' if seen else 'no'}, {delay} / {plain(some[view, 'off'])}"
