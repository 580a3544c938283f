"""Figures beside published ones, claims and their verdicts, and Markdown of both."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

from launcher.reproduce.intervals import CONFIDENCE, Interval, all_of

FACTOR: Final = 1.5
"""A figure within this factor of the published one counts as the same."""

Verdict = Literal["holds", "holds in part", "does not hold", "too few runs to tell"]
UNKNOWN: Final = "too few runs to tell"
READING: Final = (
    f"Brackets hold {CONFIDENCE:.0%} intervals over the runs. A verdict says *{UNKNOWN}* where the limit lies "
    "inside of one, or where there are too few runs for one (-)."
)
"""What goes above the claims."""


class Band(NamedTuple):
    """Where a figure should lie, ends included."""

    low: float
    high: float

    def __contains__(self, value: object) -> bool:
        return isinstance(value, int | float) and self.low <= value <= self.high

    def holds(self, figure: Interval) -> bool | None:
        """Whether the figure lies inside; None if that is open."""
        above_low = True if self.low == 0 else figure.above(self.low)
        return all_of((above_low, figure.at_most(self.high)))

    def __str__(self) -> str:
        return f"≤ {self.high:.3g}" if self.low == 0 else f"{self.low:.3g}-{self.high:.3g}"


@dataclass(frozen=True)
class Row:
    """A figure of a tracker in a case, with the figures to compare it with; None where there is none.

    ``quantity`` says what ``ours`` is and its unit. ``ratio`` is ours to ``published``, ``prototype`` the figure of an
    independent program. ``to_bound`` is ours to ``bound``, the least error that any tracker can have; it has no
    interval. ``band`` tells the bands that ``verdict`` is about.
    """

    case: str
    tracker: str
    quantity: str
    ours: Interval
    published: float | None = None
    ratio: Interval | None = None
    median_run: Interval | None = None
    lost: Interval | None = None
    bound: float | None = None
    to_bound: float | None = None
    band: str = ""
    verdict: str = ""
    prototype: float | None = None


@dataclass(frozen=True)
class Claim:
    """What a paper says, by which ``rule`` it is judged, our ``figures`` and the verdict."""

    name: str
    rule: str
    figures: str
    verdict: Verdict


def verdict(holds: bool | None) -> Verdict:
    """The verdict on a claim that cannot hold in part."""
    return "too few runs to tell" if holds is None else "holds" if holds else "does not hold"


def beside(ratio: Interval) -> str:
    """How a figure compares with the published one."""
    higher, lower = ratio.above(FACTOR), ratio.at_most(1 / FACTOR)
    if higher or lower:
        return "higher" if higher else "lower"
    return UNKNOWN if higher is None or lower is None else "as published"


def inside(figures: Sequence[Interval], bands: Sequence[Band]) -> str:
    """Whether every figure lies in its band; nothing where there are none."""
    if not bands:
        return ""
    answer = all_of(band.holds(figure) for figure, band in zip(figures, bands, strict=True))
    return UNKNOWN if answer is None else "in band" if answer else "outside"


_NUMBERS: Final = {
    "ours": "ours", "published": "published", "ratio": "ratio", "prototype": "prototype", "median_run": "median run",
    "lost": "lost", "bound": "bound", "to_bound": "to bound",
}  # fmt: skip


def rows_table(rows: Sequence[Row]) -> str:
    """The rows, with the columns in which any of them has a value."""
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


def _figure(name: str, figure: Interval | float | None) -> str:
    tell = percent if name == "lost" else plain
    return with_interval(figure, tell) if isinstance(figure, Interval) else "-" if figure is None else tell(figure)


def percent(value: float) -> str:
    """A share."""
    return f"{value:.1%}"


def plain(value: float) -> str:
    """A number to three places, or to a tenth."""
    return f"{value:.3g}" if abs(value) < 10 else f"{value:.1f}"


def with_interval(figure: Interval, tell: Callable[[float], str] = plain, unit: str = "") -> str:
    """A figure, its unit and its interval in brackets, each number told by ``tell``."""
    _, low, high = figure
    ends = "-" if low is None or high is None else f"{tell(low)}, {tell(high)}"
    return f"{tell(figure.value)}{unit} [{ends}]"


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
