"""A measured link, replayed: a CSV file gives reception and delay of frames over time."""

from __future__ import annotations

import csv
import io
from bisect import bisect_right
from pathlib import Path
from typing import Final

from trackfield.files import LONG_S, SLOW_MS, read_text
from trackfield.link.fate import FIELD, Fate, delay
from trackfield.link.places import Places
from trackfield.words import quoted

COLUMNS: Final = ("src", "dst", "t_s", "received", "delay_ms")

Line = tuple[int, Fate]
"""From when (ns) on which fate holds."""


class Trace:
    """The last line at or before the sending of a frame, for its sender and receiver, gives its fate.

    ``file`` has the columns src, dst, t_s (seconds since the start of the run), received (1 or 0) and delay_ms, its
    lines in any order. A link receives nothing before its first line, nor if it has none. If ``places`` are known,
    only links between them are kept. Raises ``ValueError`` for a file that cannot be read, with the line.
    """

    def __init__(self, seed: int, places: Places, file: str) -> None:
        self._lines: dict[tuple[str, str], list[Line]] = {}
        try:
            rows = csv.DictReader(io.StringIO(_text(file), newline=""))
            missing = [name for name in COLUMNS if name not in (rows.fieldnames or ())]
            if missing:
                raise ValueError(f"{file}: no column {', '.join(missing)}; expected {', '.join(COLUMNS)}")
            for row in rows:
                self._add(row, places, f"{file}:{rows.line_num}")
        except csv.Error as error:
            raise ValueError(f"{file}: not a CSV file ({error})") from None
        for lines in self._lines.values():
            lines.sort(key=lambda line: line[0])

    def fate(
        self,
        src: str,
        dst: str,
        kind: str,
        sent_ns: int,
        copy: int,
        size: int,
        broadcast: bool = False,
        medium: str = FIELD,
    ) -> Fate:
        """See ``Link.fate``; the same on each medium, as nothing is drawn."""
        lines = self._lines.get((src, dst), [])
        last = bisect_right(lines, sent_ns, key=lambda line: line[0])
        return lines[last - 1][1] if last else Fate("radio")

    def reception(self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0) -> float:
        """1 if frames sent at ``at_ns`` are received, else 0."""
        return float(self.fate(src, dst, "", at_ns, 0, size).cause is None)

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


def _text(file: str) -> str:
    try:
        return read_text(Path(file))
    except OSError as error:
        raise ValueError(f"{file}: cannot be read ({error.strerror})") from None
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None


def _number(row: dict[str, str], name: str, most: float) -> float:
    """The number in a column. Raises ``ValueError`` unless it is from 0 to ``most``."""
    try:
        value = float(row[name])
    except ValueError:
        raise ValueError(f"{name}: {quoted(row[name])} is not a number") from None
    if not 0 <= value <= most:  # also true for NaN
        raise ValueError(f"{name}: {value:g} is not from 0 to {most:g}")
    return value
