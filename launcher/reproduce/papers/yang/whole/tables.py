"""Table 1 of Yang et al. beside our runs with roles, and what the claims about it come to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval
from launcher.reproduce.kernels.scores import mean
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yang.claims import in_part, two
from launcher.reproduce.papers.yang.published import END_TO_END, FIELD
from launcher.reproduce.papers.yang.scores import KINDS, UNITS, mean_error, share_of
from launcher.reproduce.papers.yang.sound import RULE, found_by, listed
from launcher.reproduce.papers.yang.tables import errors, quantity
from launcher.reproduce.papers.yang.trials.field import MPH
from launcher.reproduce.papers.yang.whole.roles import DIRECTIONS, TABLE_1, WAYS, done
from launcher.reproduce.papers.yang.whole.runs import SCALARS
from launcher.reproduce.tables import (
    Band,
    Claim,
    Row,
    aligned,
    beside,
    inside,
    percent,
    plain,
    rows_table,
    with_interval,
)
from trackfield.filters.types import Array

BEST: Final = "fit + ml"
WITHOUT: Final = "fit without sds + ml"
PUBLISHED: Final = "argmax + ecpa"
TITLES: Final = {
    "roles": "With roles, sound and radio: the fixes at the base, over all passes (published: means of Table 1)",
    "table 1": "Table 1: the eight runs of the field, and ours of seeds 1 and 2",
    "roles, network": "The network in these runs",
}
"""Of the parts of the report."""
_NETWORK: Final = {"frames": "frames", "bytes": "bytes", "data": "frames with data", "interests": "interests"}


def tables(found: Found) -> dict[str, list[Row]]:
    """All tables, by name; none of a study without roles."""
    if not done(found):
        return {}
    return {
        "roles": [row for way in WAYS for row in _way(found, way)],
        "table 1": table_1_rows(found),
        "roles, network": list(_network(found)),
    }


def way_errors(found: Found, way: str, kind: str) -> Array:
    """Those (R, P) of a detector and solver, in the unit in which they are told; NaN without a fix."""
    case, tracker = WAYS[way]
    return errors(found, case, kind, tracker)


def _fixes(found: Found, way: str) -> Interval:
    """The share of all passes with a fix; its interval takes each pass as independent."""
    return share_of(np.isfinite(way_errors(found, way, "location")).ravel())


def _way(found: Found, way: str) -> Iterator[Row]:
    case, tracker = WAYS[way]
    for column, kind in enumerate(KINDS):
        ours = mean_error(way_errors(found, way, kind))
        published = FIELD[column] if way == PUBLISHED else None
        band = Band(0, END_TO_END[column]) if way == BEST else None
        ratio = None if published is None else ours.over(published)
        told = "" if ratio is None else beside(ratio)
        yield Row(
            *(way, tracker, quantity(kind), ours),
            published=published,
            ratio=ratio,
            band="" if band is None else str(band),
            verdict=told if band is None else inside([ours], [band]),
        )
    yield Row(way, tracker, "share of passes with a fix", _fixes(found, way))
    delay = found.figures[case][f"delay {tracker}"]
    yield Row(way, tracker, "known at the base after the last CPA, s", mean_error(delay))


def _network(found: Found) -> Iterator[Row]:
    for case in dict.fromkeys(case for case, _ in WAYS.values()):
        for name in SCALARS:
            yield Row(case, "-", f"{_NETWORK[name]} for a pass", mean(found.figures[case][name]))


def table_1_rows(found: Found) -> list[Row]:
    """The errors in the eight runs of the field, and in ours: of each direction the passes of the first two seeds."""
    seen = dict.fromkeys(DIRECTIONS, 0)
    rows = []
    for number, run in enumerate(TABLE_1, 1):
        seed, direction = seen[run.direction], DIRECTIONS.index(run.direction)
        seen[run.direction] += 1
        for way in (PUBLISHED, BEST):
            for kind, unit, published in zip(KINDS, (1.0, MPH, 1.0), run[1:], strict=True):
                some = way_errors(found, way, kind) / unit
                if seed < len(some) and np.isfinite(some[seed, direction]):
                    value = float(some[seed, direction])
                    ours = Interval(value, value, value)
                    rows.append(Row(f"{number} {run.direction}", way, quantity_of(kind), ours, published))
    return rows


def quantity_of(kind: str) -> str:
    """A kind of error and its unit in Table 1."""
    return "speed, mph" if kind == "speed" else quantity(kind)


def parts(found: Found) -> list[tuple[str, str]]:
    """All tables, with their headings."""
    return [(TITLES[name], text(name, rows)) for name, rows in tables(found).items()]


def text(name: str, rows: Sequence[Row]) -> str:
    """The table of this name, in Markdown."""
    return _table_1(rows) if name == "table 1" else rows_table(rows)


def _table_1(rows: Sequence[Row]) -> str:
    """A line for each run: the errors of the paper, and ours."""
    runs: dict[str, dict[tuple[str, str], Row]] = {
        f"{number} {run.direction}": {} for number, run in enumerate(TABLE_1, 1)
    }
    for row in rows:
        runs[row.case][row.tracker, row.quantity] = row
    kinds, ways = [quantity_of(kind) for kind in KINDS], (PUBLISHED, BEST)
    body = []
    for run, some in runs.items():
        published = [plain(value) for value in _published(run)]
        body.append([run, *published, *(_three([some.get((way, kind)) for kind in kinds]) for way in ways)])
    return aligned(("run", *kinds, *(f"ours, {way}" for way in ways)), body)


def _published(run: str) -> tuple[float, float, float]:
    """The errors of the paper in the run with this name."""
    _, *errors = TABLE_1[int(run.split(maxsplit=1)[0]) - 1]
    location, speed, heading = map(float, errors)
    return location, speed, heading


def _three(rows: Sequence[Row | None]) -> str:
    given = [row.ours.value for row in rows if row is not None]
    return " / ".join(map(plain, given)) if len(given) == len(rows) else "no fix"


def claims(found: Found) -> list[Claim]:
    """Those about whole runs; none of a study without roles."""
    return [_field(found), _best(found)] if done(found) else []


def _field(found: Found) -> Claim:
    means = [mean_error(way_errors(found, PUBLISHED, kind)) for kind in KINDS]
    told = [
        f"{kind} {two(one)} {UNITS[kind]} ({limit:.3g})" for kind, one, limit in zip(KINDS, means, FIELD, strict=True)
    ]
    return Claim(
        "With roles: the average errors are 1.8 m, 3 mph and 5 deg (Table 1)",
        "with argmax and ecpa, from sound through radio, mean errors are at most those of Table 1; in part: some are",
        ", ".join(told),
        in_part([one.at_most(limit) for one, limit in zip(means, FIELD, strict=True)]),
    )


def _best(found: Found) -> Claim:
    means, even = ([mean_error(way_errors(found, way, kind)) for kind in KINDS] for way in (BEST, WITHOUT))
    there = _fixes(found, BEST)
    return Claim(
        "(Not in the paper) With roles: the fit and maximum likelihood find the path, from sound through radio",
        f"with sds in the reports, {RULE} of the passes have a fix",
        f"{listed(means)}; without sds: {listed(even)}; a fix in {with_interval(there, percent)}",
        found_by(means, there),
    )
