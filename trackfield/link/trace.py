"""A measured link, replayed: a file says what became of frames over time, or has delivery ratios (``measured``)."""

from __future__ import annotations

import csv
import io
import zlib
from bisect import bisect_right
from hashlib import blake2b
from pathlib import Path
from typing import Any, Final

from trackfield.files import GZIP, LONG_S, SLOW_MS, read_bytes, text_of, unpacked
from trackfield.link.fate import FIELD, Fate, Link, Transmission, delay
from trackfield.link.k7 import Recording, is_k7, parse_k7
from trackfield.link.measured import Measured
from trackfield.link.places import Places
from trackfield.words import quoted

COLUMNS: Final = ("src", "dst", "t_s", "received", "delay_ms")

Line = tuple[int, Fate]
"""From when (ns) on which fate holds."""
_OF_RATIOS: Final = ("only_channel", "start_s", "nodes")
"""Options that say which part of a recording counts."""
_HEAD: Final = 4096
_LAST: Final[dict[tuple[str, bytes, frozenset[str] | None], Recording]] = {}
"""By file, content and nodes."""


def trace(seed: int, places: Places, file: str, **options: Any) -> Link:
    """The link that a file describes, by its content: ``Measured`` if it is in k7 form, else a ``Trace``.

    Either may be packed with gzip. The ``options`` are those of ``Measured``; a trace of frames, which says of each
    what becomes of it, has no use for a radio's, and none of the others. If ``places`` are known, only links between
    them are kept. Raises ``ValueError`` for a file that cannot be read, with the line, and for options that do not fit.
    """
    text, nodes = text_in(file), options.get("nodes")
    known = places if nodes is None else [node for id, node in nodes.items() if id in places]
    recording = recording_in(text, file, frozenset(known) if places else None)
    if recording is not None:
        return Measured(seed, recording, **options)
    for name in _OF_RATIOS:
        if value := options.get(name):
            what = "is for files of delivery ratios, in k7 form; this one says of each frame what becomes of it"
            raise ValueError(f"{name}: {quoted(value)} {what}")
    return Trace(places, text, file)


def has_ratios(file: str) -> bool:
    """Whether a file has delivery ratios, by how it begins; False if it cannot be read."""
    path = Path(file)
    try:
        if not path.is_file():
            return False
        with path.open("rb") as stream:
            head = stream.read(_HEAD)
        if head.startswith(GZIP):
            head = zlib.decompressobj(wbits=31).decompress(head, _HEAD)
        return is_k7(head.decode("utf-8-sig", errors="replace"))
    except (OSError, ValueError, zlib.error):
        return False


def recording_in(text: str, file: str, only: frozenset[str] | None = None) -> Recording | None:
    """The delivery ratios in the text of a file, or of them those between ``only`` these nodes; None if it has none.

    Raises ``ValueError`` as ``parse_k7`` does. A launcher asks for the same ones many times, so the last is kept.
    """
    if not is_k7(text):
        return None
    key = (file, blake2b(text.encode()).digest(), only)
    if key not in _LAST:
        _LAST.clear()
        _LAST[key] = parse_k7(text, file, only)
    return _LAST[key]


def text_in(file: str) -> str:
    """The text of a file, which may be packed with gzip. Raises ``ValueError`` if it cannot be read."""
    try:
        return text_of(unpacked(read_bytes(Path(file))))
    except OSError as error:
        raise ValueError(f"{file}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


class Trace:
    """The last line at or before the sending of a frame, for its sender and receiver, gives its fate.

    The ``text`` of ``file`` has the columns src, dst, t_s (seconds since the start of the run), received (1 or 0) and
    delay_ms, its lines in any order. A link receives nothing before its first line, nor if it has none. If ``places``
    are known, only links between them are kept. Raises ``ValueError`` for a text that is none, with the line.
    """

    def __init__(self, places: Places, text: str, file: str) -> None:
        self._lines: dict[tuple[str, str], list[Line]] = {}
        try:
            rows = csv.DictReader(io.StringIO(text, newline=""))
            missing = [name for name in COLUMNS if name not in (rows.fieldnames or ())]
            if missing:
                raise ValueError(f"{file}: no column {', '.join(missing)}; expected {', '.join(COLUMNS)}")
            for row in rows:
                self._add(row, places, f"{file}:{rows.line_num}")
        except csv.Error as error:
            raise ValueError(f"{file}: not a CSV file ({error})") from None
        for lines in self._lines.values():
            lines.sort(key=lambda line: line[0])

    def fate(self, frame: Transmission) -> Fate:
        """See ``Link.fate``; the same on each medium, as nothing is drawn."""
        lines = self._lines.get((frame.src, frame.dst), [])
        last = bisect_right(lines, frame.sent_ns, key=lambda line: line[0])
        return lines[last - 1][1] if last else Fate("radio")

    def reception(
        self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0, medium: str = FIELD
    ) -> float:
        """1 if frames sent at ``at_ns`` are received, else 0."""
        return float(self.fate(Transmission(src, dst, "", at_ns, 0, size)).cause is None)

    def _add(self, row: dict[str, str], places: Places, where: str) -> None:
        link = (row["src"], row["dst"])
        try:
            if any(row[name] is None for name in COLUMNS):
                raise ValueError("has too few cells")
            t_s, delay_ms = _number(row, "t_s", LONG_S), _number(row, "delay_ms", SLOW_MS)
            received = row["received"].strip()
            if received not in ("0", "1"):
                raise ValueError(f"received: {quoted(received)} is not 0 or 1")
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None
        if not places or places.keys() >= set(link):
            fate = Fate(None, delay(delay_ms)) if received == "1" else Fate("radio")
            self._lines.setdefault(link, []).append((round(t_s * 1e9), fate))


def _number(row: dict[str, str], name: str, most: float) -> float:
    """The number in a column. Raises ``ValueError`` unless it is from 0 to ``most``."""
    try:
        value = float(row[name])
    except ValueError:
        raise ValueError(f"{name}: {quoted(row[name])} is not a number") from None
    if not 0 <= value <= most:  # also true for NaN
        raise ValueError(f"{name}: {value:g} is not from 0 to {most:g}")
    return value
