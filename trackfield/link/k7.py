"""Recordings of delivery ratios in k7 form, as the Mercator data sets and the 6TiSCH simulator have them.

The first line is a JSON header with ``tx_length``, the bytes of a frame, and ``interframe_duration``, the milliseconds
between two. Then come lines datetime,src,dst,channel,mean_rssi,pdr,tx_count, in any order: ``src`` sent ``tx_count``
frames in a row on a channel, and ``dst`` received a share ``pdr`` of them, with a mean RSSI in dBm. All nodes listen
to each such burst; those without a line received nothing.
"""

from __future__ import annotations

import json
from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from math import inf, isfinite
from typing import Any, Final, NamedTuple

from trackfield.words import quoted

COLUMNS: Final = "datetime,src,dst,channel,mean_rssi,pdr,tx_count"
SYNC_BYTES: Final = 6
"""Preamble, delimiter and length, which a frame has on the air before the bytes that ``tx_length`` counts."""
BYTE_S: Final = 32e-6
"""Time on air of a byte at 250 kbit/s."""
_MOST_BYTES: Final = 127
_MOST_MS: Final = 3_600_000
_MOST_FRAMES: Final = 1_000_000
_MOST_CHANNEL: Final = 1000
_LOUD_DBM: Final = 100
_LONGEST_ID: Final = 32


class Heard(NamedTuple):
    """What a node received of a burst: the share of its frames, and their mean RSSI in dBm."""

    pdr: float
    rssi_dbm: float


@dataclass(slots=True)
class Burst:
    """Frames sent in a row from ``at_s`` on, in seconds from the begin of the recording, and who ``heard`` them."""

    at_s: float
    channel: int
    frames: int
    heard: dict[str, Heard] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Recording:
    """The ``bursts`` of each sender in the order of time, of frames of ``frame_bytes`` on the air, one per ``frame_s``.

    ``nodes`` are all that occur, by number if all are numbers; ``channels`` likewise. It lasts ``end_s`` seconds.
    """

    frame_bytes: int
    frame_s: float
    nodes: tuple[str, ...]
    channels: tuple[int, ...]
    end_s: float
    bursts: dict[str, list[Burst]]


class _Line(NamedTuple):
    at_s: float
    number: int
    src: str
    dst: str
    channel: str
    cells: str


@dataclass(frozen=True, slots=True)
class _Seen:
    """What all lines have, also those that are not kept."""

    nodes: set[str] = field(default_factory=set)
    channels: set[str] = field(default_factory=set)
    stamps: dict[str, float] = field(default_factory=dict)


class _All:
    """Contains every node."""

    def __contains__(self, node: object) -> bool:
        return True


def is_k7(text: str) -> bool:
    """Whether a text begins as a recording in k7 form does, with a JSON object."""
    return text[:100].lstrip().startswith("{")


def parse_k7(text: str, file: str, only: Container[str] | None = None) -> Recording:
    """The recording, or of it what ``only`` these nodes sent and heard.

    Raises ``ValueError`` for a text that is not one, with the file and the line; of lines about other nodes no more
    than their nodes and times is looked at.
    """
    kept = _All() if only is None else only
    size, frame_s, rows = _head(text, file)
    seen = _Seen()
    lines = sorted(_lines(rows, file, kept, seen))
    if not seen.nodes:
        raise ValueError(f"{file}: has no lines after its header; expected {COLUMNS}")
    odd = [node for node in seen.nodes if not 0 < len(node) <= _LONGEST_ID]
    if odd:
        raise ValueError(f"{file}: {quoted(odd[0])} is not the id of a node, of 1 to {_LONGEST_ID} characters")
    begin_s, end_s = min(seen.stamps.values()), max(seen.stamps.values())
    bursts: dict[str, list[Burst]] = {}
    for line in lines:
        _add(bursts.setdefault(line.src, []), line, begin_s, frame_s, kept, file)
    channels = tuple(sorted(_whole(channel, "channel", file, _MOST_CHANNEL) for channel in seen.channels))
    return Recording(size, frame_s, _sorted(seen.nodes), channels, end_s - begin_s, bursts)


def _head(text: str, file: str) -> tuple[int, float, list[str]]:
    """The bytes of a frame on the air, the seconds from one frame to the next, and the lines."""
    first, *rows = text.split("\n")
    try:
        head: Any = json.loads(first)
    except (ValueError, RecursionError):
        raise ValueError(f"{file}:1: is not a JSON header, as a k7 file begins with") from None
    size = _of_head(head, "tx_length", 1, _MOST_BYTES, file)
    gap_ms = _of_head(head, "interframe_duration", 0, _MOST_MS, file)
    on_air = round(size) + SYNC_BYTES
    if not rows or rows[0].strip() != COLUMNS:
        raise ValueError(f"{file}:2: is not the line {COLUMNS}")
    return on_air, max(gap_ms / 1000, on_air * BYTE_S), rows[1:]


def _of_head(head: Any, name: str, least: float, most: float, file: str) -> float:
    value = head.get(name) if isinstance(head, dict) else None
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise ValueError(f"{file}:1: {name}: {quoted(value)} is not a number from {least:g} to {most:g}")
    return value


def _lines(rows: list[str], file: str, kept: Container[str], seen: _Seen) -> Iterator[_Line]:
    """The lines of the ``kept`` senders; what was ``seen`` in any line is noted."""
    nodes, channels, stamps = seen.nodes, seen.channels, seen.stamps
    for number, row in enumerate(rows, 3):
        stamp, _, cells = row.partition(",")
        if row.count(",") != 6:
            if row.strip():
                raise ValueError(f"{file}:{number}: has {row.count(',') + 1} cells, not the 7 of {COLUMNS}")
            continue
        if stamp not in stamps:
            stamps[stamp] = _seconds(stamp, f"{file}:{number}")
        src, dst, channel, cells = cells.split(",", 3)
        nodes.add(src)
        nodes.add(dst)
        channels.add(channel)
        if src in kept:
            yield _Line(stamps[stamp], number, src, dst, channel, cells)


def _seconds(stamp: str, where: str) -> float:
    """Seconds since a fixed instant; times without a zone are in UTC."""
    try:
        at = datetime.fromisoformat(stamp)
    except ValueError:
        raise ValueError(f"{where}: datetime: {quoted(stamp)} is not a date and time") from None
    return (at if at.tzinfo else at.replace(tzinfo=UTC)).timestamp()


def _add(bursts: list[Burst], line: _Line, begin_s: float, frame_s: float, kept: Container[str], file: str) -> None:
    """Put a line into the last burst of its sender, or begin a new one.

    A line is stamped when the first frame of its burst is received. So those of one burst are at most as far apart as
    it is long; twice that is still far less than what is between two bursts of a sender.
    """
    where = f"{file}:{line.number}"
    rssi_cell, pdr_cell, frames_cell = line.cells.split(",")
    channel, frames = _whole(line.channel, "channel", where, _MOST_CHANNEL), _whole(frames_cell, "tx_count", where)
    at_s, last = line.at_s - begin_s, bursts[-1] if bursts else None
    if last is None or last.channel != channel or at_s - last.at_s > 2 * frames * frame_s:
        last = Burst(at_s, channel, frames)
        bursts.append(last)
    if line.dst not in kept:
        return
    if line.dst in last.heard:
        raise ValueError(f"{where}: {quoted(line.dst)} is there twice in a burst of {quoted(line.src)}")
    pdr, rssi = _number(pdr_cell, "pdr", 0, 1, where), _number(rssi_cell, "mean_rssi", -inf, _LOUD_DBM, where)
    if pdr:
        last.heard[line.dst] = Heard(pdr, rssi)


def _number(cell: str, name: str, least: float, most: float, where: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        raise ValueError(f"{where}: {name}: {quoted(cell)} is not a number") from None
    if not (isfinite(value) and least <= value <= most):
        span = f"at most {most:g}" if least == -inf else f"from {least:g} to {most:g}"
        raise ValueError(f"{where}: {name}: {value:g} is not a number {span}")
    return value


def _whole(cell: str, name: str, where: str, most: int = _MOST_FRAMES) -> int:
    cell = cell.strip()
    if not (cell.isascii() and cell.isdigit() and len(cell) < 10 and 0 < int(cell) <= most):
        raise ValueError(f"{where}: {name}: {quoted(cell)} is not a whole number from 1 to {most}")
    return int(cell)


def _sorted(nodes: set[str]) -> tuple[str, ...]:
    numbers = all(node.isascii() and node.isdigit() for node in nodes)
    return tuple(sorted(nodes, key=lambda node: (int(node), node) if numbers else (0, node)))
