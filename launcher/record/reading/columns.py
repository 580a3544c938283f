"""The columns of a run's tables, and what may stand in them (docs/metrics.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, get_args, get_type_hints

import pyarrow as pa

from launcher.files import MESSAGES_TABLE, TRACKS_TABLE
from launcher.record.figures.frames import MOST
from launcher.record.tables import STATE
from launcher.records import ARRIVED
from trackfield.role import TrackPoint

MOST_NS: Final = 1 << 61
"""The latest instant of a run, and how long before its start a time can be, ns (73 years)."""
MOST_S: Final = MOST_NS / 1e9
_MOST_INT: Final = (1 << 31) - 1
_MOST_VALUE: Final = 1e27
"""Of a number that a sensor reported: 10^15 steps of the coarsest resolution."""
_LOSSES: Final = ("partition", "radio", "in_flight", "dead", "frozen", "asleep", "overflow", "host_lost")


@dataclass(frozen=True)
class Column:
    """A column: its type, and whether a row may have no value.

    Numbers are ``least`` to ``most`` (None: any), and not NaN or infinite if they are ``finite``; a list has
    ``length`` of them (None: any number); a text is one of those ``known`` (none: any).
    """

    type: pa.DataType
    nulls: bool = False
    least: float | None = None
    most: float = 0
    finite: bool = False
    length: int | None = None
    known: frozenset[str] = frozenset()


def _float(most: float, *, nulls: bool = False) -> Column:
    return Column(pa.float64(), nulls, -most, most, finite=True)


_TEXT: Final = Column(pa.string())
_TIME: Final = Column(pa.int64(), least=-MOST_NS, most=MOST_NS)
_TIME_IF_ANY: Final = Column(pa.int64(), True, -MOST_NS, MOST_NS)
_COUNT: Final = Column(pa.int32(), least=0, most=_MOST_INT)
_STEP: Final = Column(pa.int32(), True, 0, _MOST_INT)
_SECONDS: Final = _float(MOST_S)

COLUMNS: Final[Mapping[str, Mapping[str, Column]]] = {
    TRACKS_TABLE: {
        "t_s": _SECONDS,
        "step": _STEP,
        **dict.fromkeys(("source", "target", "tracker"), _TEXT),
        "status": Column(pa.string(), known=frozenset(get_args(get_type_hints(TrackPoint)["status"]))),
        "reports": _COUNT,
        "told_s": _SECONDS,
        # a filter that has diverged publishes what it has
        **dict.fromkeys(STATE, Column(pa.float64(), nulls=True)),
        "covariance": Column(pa.list_(pa.float64()), nulls=True, length=16),
        **{f"true_{name}": _float(MOST, nulls=True) for name in STATE},
        "true_target": Column(pa.string(), nulls=True),
        "true_interpolated": Column(pa.bool_()),
        "bound_m": _float(MOST, nulls=True),
        "sensors": Column(pa.list_(pa.string())),
        **dict.fromkeys(("lag", "term"), _COUNT),
        **dict.fromkeys(("at_ns", "told_ns"), _TIME),
        "incarnation": _COUNT,
        "origin": _TEXT,
        **dict.fromkeys(("unknowns", "unknown_sds"), Column(pa.list_(pa.float64()))),
        "known_step": _STEP,
        "event_ns": _TIME_IF_ANY,
        "refused": _TEXT,
    },
    MESSAGES_TABLE: {
        **dict.fromkeys(("kind", "src", "dst", "medium"), _TEXT),
        "sent_ns": _TIME,
        "due_ns": _TIME_IF_ANY,
        "outcome": Column(pa.string(), known=frozenset((*ARRIVED, *_LOSSES))),
        **dict.fromkeys(("bytes", "copy", "incarnation"), _COUNT),
        "text": _TEXT,
        "values": Column(pa.list_(pa.float64()), least=-_MOST_VALUE, most=_MOST_VALUE, finite=True),
        "step": _STEP,
        "local_ns": _TIME_IF_ANY,
        "payload": Column(pa.binary()),
    },
}
"""The columns of each table of a run folder, by their names."""
