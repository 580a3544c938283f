"""Figures beside published ones, claims and their verdicts, and Markdown of both."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

FACTOR: Final = 1.5
"""A figure within this factor of the published one counts as the same."""

Verdict = Literal["holds", "holds in part", "does not hold"]


class Band(NamedTuple):
    """Where a figure should lie, ends included."""

    low: float
    high: float

    def __contains__(self, value: object) -> bool:
        return isinstance(value, int | float) and self.low <= value <= self.high

    def __str__(self) -> str:
        return f"≤ {self.high:.3g}" if self.low == 0 else f"{self.low:.3g}-{self.high:.3g}"


@dataclass(frozen=True)
class Row:
    """A figure of a tracker in a case, with what it is to be compared with; None where there is nothing.

    ``quantity`` says what ``ours`` is and its unit. ``ratio`` is ours to ``published``, ``to_bound`` ours to ``bound``,
    the least error that any tracker can have. ``band`` tells the bands that ``verdict`` is about.
    """

    case: str
    tracker: str
    quantity: str
    ours: float
    published: float | None = None
    ratio: float | None = None
    median_run: float | None = None
    lost: float | None = None
    bound: float | None = None
    to_bound: float | None = None
    band: str = ""
    verdict: str = ""


@dataclass(frozen=True)
class Claim:
    """What a paper says, by which ``rule`` it is judged, our ``figures`` and the verdict."""

    name: str
    rule: str
    figures: str
    verdict: Verdict


def verdict(holds: bool) -> Verdict:
    """That of a claim that cannot hold in part."""
    return "holds" if holds else "does not hold"


def beside(ratio: float) -> str:
    """What a figure is, compared with the published one."""
    if ratio > FACTOR:
        return "higher"
    return "lower" if ratio < 1 / FACTOR else "as published"


def inside(values: Sequence[float], bands: Sequence[Band]) -> str:
    """Whether every value lies in its band; nothing where there are none."""
    if not bands:
        return ""
    return "in band" if all(value in band for value, band in zip(values, bands, strict=True)) else "outside"


_NUMBERS: Final = {
    "ours": "ours", "published": "published", "ratio": "ratio", "median_run": "median run", "lost": "lost",
    "bound": "bound", "to_bound": "to bound",
}  # fmt: skip


def rows_table(rows: Sequence[Row]) -> str:
    """The rows with those columns in which any of them has something to say."""
    used = [name for name in _NUMBERS if any(getattr(row, name) is not None for row in rows)]
    texts = [name for name in ("band", "verdict") if any(getattr(row, name) for row in rows)]
    header = ["case", "tracker", "figure", *(_NUMBERS[name] for name in used), *texts]
    body = [
        [
            *(row.case, row.tracker, row.quantity),
            *(_figure(name, getattr(row, name)) for name in used),
            *(getattr(row, name) for name in texts),
        ]
        for row in rows
    ]
    if len({row.quantity for row in rows}) == 1:  # then it heads our column
        header[3] = body[0][2]
        header, *body = ([*line[:2], *line[3:]] for line in (header, *body))
    return aligned(header, body)


def _figure(name: str, value: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:.1%}" if name == "lost" else f"{value:.3g}" if abs(value) < 10 else f"{value:.1f}"


def claims_table(claims: Iterable[Claim]) -> str:
    """A row for each claim."""
    rows = [(claim.name, claim.rule, claim.figures, claim.verdict) for claim in claims]
    return aligned(("the paper claims", "holds if", "figures", "verdict"), rows, align=False)


def aligned(header: Sequence[str], rows: Iterable[Sequence[str]], *, align: bool = True) -> str:
    """A Markdown table, padded so that it reads as plain text too."""
    body = [list(row) for row in rows]
    widths = [max(map(len, column)) if align else 0 for column in zip(header, *body, strict=True)]
    lines: Iterator[str] = (
        f"| {' | '.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))} |"
        for row in (list(header), ["---"] * len(header), *body)
    )
    return "\n".join(lines)
