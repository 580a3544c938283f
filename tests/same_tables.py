"""What tells the tables of two runs apart, bit for bit (``tests/same_as.py``)."""

from __future__ import annotations

import struct
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from itertools import zip_longest
from typing import Any, Final, NamedTuple

import pyarrow as pa

STATE: Final = ("x", "y", "vx", "vy")
IDENTITY: Final = ("sent_ns", "src", "dst", "kind", "copy", "incarnation")
"""Which frame it is, and at which hearer."""
FATE: Final = ("medium", "due_ns", "outcome", "bytes", "payload")
"""What is known of it."""
FRAME: Final = IDENTITY + FATE


class Point(NamedTuple):
    """Which point of a track it is (``step`` -1: of none); ``nth`` counts those that are the same otherwise."""

    step: int
    target: str
    tracker: str
    lag: int
    nth: int

    def __str__(self) -> str:
        lag = f" lag {self.lag}" if self.lag else ""
        return f"{self.tracker}{lag} of {self.target}, step {self.step}"


Values = dict[str, Any]
Frame = tuple[Any, ...]


def differences(
    old_tracks: pa.Table, new_tracks: pa.Table, old_messages: pa.Table, new_messages: pa.Table
) -> tuple[list[str], list[str]]:
    """The values of tracks, and the frames, that are not the same, each as text, the earliest first."""
    values = track_differences(points(old_tracks), points(new_tracks))
    return values, frame_differences(frames(old_messages), frames(new_messages))


# --- tracks -----------------------------------------------------------------------------------------------------------


def points(table: pa.Table) -> dict[Point, Values]:
    """The points of tracks.parquet. The lag of a smoothed track is in a column, or in its name: ``ukf+lag3``."""
    columns = [table[name].to_pylist() for name in ("step", "target", "tracker")]
    lags = table["lag"].to_pylist() if "lag" in table.column_names else [0] * table.num_rows
    names = ("status", "reports", *STATE)
    values = zip(*(table[name].to_pylist() for name in names), strict=True)
    seen, found = Counter[tuple[Any, ...]](), {}
    for step, target, name, lag, row, covariance in zip(
        *columns, lags, values, table["covariance"].to_pylist(), strict=True
    ):
        tracker, _, lagged = name.partition("+lag")
        key = (-1 if step is None else step, target, tracker, int(lagged or lag or 0))
        spread = {f"covariance[{i}]": value for i, value in enumerate(covariance or ())}
        found[Point(*key, seen[key])] = dict(zip(names, row, strict=True)) | spread
        seen[key] += 1
    return found


def track_differences(old: dict[Point, Values], new: dict[Point, Values]) -> list[str]:
    """A line for each value that differs, and for each point that one run alone has."""
    found = []
    for point in sorted(old.keys() | new.keys()):
        if point not in old or point not in new:
            found.append(f"{point}: only in the {'old' if point in old else 'new'} run")
            continue
        a, b = old[point], new[point]
        found += [
            f"{point}: {name} {a.get(name)!r}, now {b.get(name)!r}"
            for name in dict.fromkeys([*a, *b])
            if bits(a.get(name)) != bits(b.get(name))
        ]
    return found


def bits(value: object) -> object:
    """Equal for equal bits alone: 0.0 is not -0.0, and a NaN is itself."""
    return struct.pack("<d", value) if isinstance(value, float) else value


# --- frames -----------------------------------------------------------------------------------------------------------


def frames(table: pa.Table) -> Counter[Frame]:
    """The frames of messages.parquet with their fates, as ``FRAME`` has them."""
    return Counter(zip(*(table[name].to_pylist() for name in FRAME), strict=True))


def frame_differences(old: Counter[Frame], new: Counter[Frame]) -> list[str]:
    """A line for each frame whose fate differs, and for each that one run alone has."""
    gone, come = _by_identity((old - new).elements()), _by_identity((new - old).elements())
    return [
        f"{kind} from {src} to {dst} at {sent_ns / 1e9:.6f} s: {what}"
        for identity in sorted(gone.keys() | come.keys())
        for sent_ns, src, dst, kind, *_ in [identity]
        for what in _fates(gone.get(identity, []), come.get(identity, []))
    ]


def _by_identity(some: Iterable[Frame]) -> dict[Frame, list[Frame]]:
    found = defaultdict(list)
    for frame in some:
        found[frame[: len(IDENTITY)]].append(frame[len(IDENTITY) :])
    return found


def _fates(gone: list[Frame], come: list[Frame]) -> Iterator[str]:
    for a, b in zip_longest(gone, come):
        if a is None or b is None:
            yield f"only in the {'new' if a is None else 'old'} run"
        else:
            changes = (f"{name} {x!r}, now {y!r}" for name, x, y in zip(FATE, a, b, strict=True) if x != y)
            yield "; ".join(changes)
