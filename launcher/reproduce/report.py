"""A study in words: its tables and claims as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from launcher.reproduce.papers.zhai.claims import claims
from launcher.reproduce.papers.zhai.tables import FACTOR, RADAR_SHARE, Row, tables, thresholds
from launcher.reproduce.scores import Results

TITLES: Final = {
    "table I": f"Table I: published and ours in s1, 75 % (a figure within a factor of {FACTOR:g} is *as published*)",
    "scenarios": "Scenarios 1 to 3, 75 %",
    "thresholds": "Thresholds",
    "nominals": "Filters in the bank, N, in s1",
    "particles": "Particles, Ns, in s1",
    "radar": f"One radar (with bearings at most {RADAR_SHARE:g} of what predicting alone leaves)",
    "causes": "What the bootstrap's errors are due to: its prior in s1, its model in s2 and s3",
}
_NUMBERS: Final = {
    "ours": "ours", "published": "published", "ratio": "ratio", "median_run": "median run", "lost": "lost",
    "bound": "bound", "to_bound": "to bound",
}  # fmt: skip

FIGURES: Final = (
    ("fig03", "one radar: places and errors of a typical run", "SP-CPF closest; EKF and bootstrap astray"),
    ("fig04", "sensors that report at 72, 75 and 78 %, in s1", "one or two at a time at 78 %"),
    ("fig05", "RMSE(t) over all runs of s1", "means: SP-CPF 1.91, 4.00 m; bootstrap 23.2, 30.1 m (dotted)"),
    ("fig06", "a typical run of s1", "SP-CPF on the path; the bootstrap in its direction, far off"),
    ("fig07", "its velocity and acceleration", "no figures"),
    ("fig08", "RMSE(t) over all runs of s2", "SP-CPF only, as the bootstrap loses more than 80 % of the runs"),
    ("fig09", "a typical run of s2", "SP-CPF on the path"),
    ("fig10", "its velocity and acceleration", "no figures"),
    ("fig11", "a typical run of s3", "SP-CPF on the path; the bootstrap loses it"),
    ("fig12", "its velocity and acceleration", "the bootstrap misses the change of acceleration"),
    ("fig13", "RMSE(t) over all runs of s3", "no figures"),
    ("sweeps", "error over N and over Ns in s1", "10 ≤ N ≤ 20 (shaded); 200 particles"),
)
"""Name, what it shows, and what the paper has of it. Acceleration is the difference of successive velocities."""


def markdown(results: Results) -> str:
    """The claims, all tables, and what the figures show."""
    parts = [f"## {TITLES[name]}\n\n{_table(rows)}" for name, rows in tables(results).items()]
    parts.insert(3, f"## What the network does for it\n\n{_network(results)}")
    parts.insert(1, f"## What trackers cost, in s1\n\n{_costs(results)}")
    parts.append(f"## Figures\n\n{aligned(('file', 'shows', 'the paper has'), FIGURES)}")
    return "\n\n".join([f"## Claims\n\n{claims_table(results)}", *parts]) + "\n"


def claims_table(results: Results) -> str:
    """A row for each claim."""
    rows = [(claim.name, claim.rule, claim.figures, claim.verdict) for claim in claims(results)]
    return aligned(("the paper claims", "holds if", "figures", "verdict"), rows, align=False)


def _table(rows: Sequence[Row]) -> str:
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


def _network(results: Results) -> str:
    header = (
        "case", "active in a step", "one or two", "none", "frames", "bytes of payload", "sending, mJ", "all nodes, J",
    )  # fmt: skip
    rows = []
    for case in thresholds():
        field = results.fields[case]
        rows.append(
            [
                case,
                f"{field.active:.1f}",
                f"{field.few:.1%}",
                f"{field.silent:.1%}",
                f"{field.frames:.0f}",
                f"{field.payload_bytes:.0f}",
                f"{1e3 * field.send_j:.1f}",
                f"{field.total_j:.2f}",
            ]
        )
    return aligned(header, rows)


def _costs(results: Results) -> str:
    rows = [
        [name, f"{1e3 * time_s:.1f}", f"{time_s / results.times['bootstrap']:.2f}"]
        for name, time_s in results.times.items()
    ]
    return aligned(("tracker", "processor time of a run, ms", "over bootstrap's"), rows)


def aligned(header: Sequence[str], rows: Iterable[Sequence[str]], *, align: bool = True) -> str:
    """A Markdown table, padded so that it reads as plain text too."""
    body = [list(row) for row in rows]
    widths = [max(map(len, column)) if align else 0 for column in zip(header, *body, strict=True)]
    lines: Iterator[str] = (
        f"| {' | '.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))} |"
        for row in (list(header), ["---"] * len(header), *body)
    )
    return "\n".join(lines)
