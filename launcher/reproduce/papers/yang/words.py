"""The study of Yang et al. (2009) in words: its parts in their order, and what the figures show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yang.checks import check_rows, checks, message_rows, triggered_rows
from launcher.reproduce.papers.yang.scores import KINDS
from launcher.reproduce.papers.yang.solved.costs import costs
from launcher.reproduce.papers.yang.solved.messages import sent
from launcher.reproduce.papers.yang.sound import sound_rows
from launcher.reproduce.papers.yang.success import ablation_rows, reason_rows, reasons, success_rows
from launcher.reproduce.papers.yang.tables import GROUPS, quantity, sweep_tables
from launcher.reproduce.tables import Row, aligned, plain, rows_table, with_interval

TITLES: Final[Mapping[str, str]] = {
    "checks": "Closed forms",
    "success": "How often a path is found and right (5 m, 15 deg)",
    "reasons": "Why the original algorithm fails, in shares of the runs",
    "ablation": "ECPA without one of its differences from the original, and told how the path divides the nodes",
    "velocity": "Speeds, with times whose error falls with v^-3.3 (fig. 14)",
    "width": "Speeds, with times whose error falls with 1 / v, as the width of a pulse does",
    "constant": "Speeds, with times whose error is the same at all",
    "places": "Places of nodes that are wrong by up to so much (fig. 15)",
    "area": "Areas (fig. 16)",
    "nodes": "Numbers of nodes, and of those that do not report",
    "clocks": "Errors of clocks",
    "bound": "Maximum likelihood beside the Cramer-Rao bound",
    "sound": "From sound to path, 10 dB at 20 m, without radio",
    "triggered": "Nodes that a target triggers in 5 s",
    "messages": "What is sent for a pass of five nodes",
    "costs": "What is computed for a pass of five nodes",
}
"""Of the parts of the report, in their order."""

FIGURES: Final = (
    ("fig02", "eq. 22: the error of r in the original algorithm", "the same surface"),
    ("fig03", "eq. 24: the error of phi", "the same surface"),
    ("fig04", "its contours, with the white regions below 10 deg", "the same contours"),
    ("fig08", "eq. 37: the bound on the error of r_1 in ECPA", "the same surface"),
    ("fig10", "what a node hears of a pass, and when each detector says that it was nearest", "a recording of 5 s"),
    ("fig12", "the paths of eight passes with roles (not without them)", "those of Table 1"),
    ("fig13", "how often CPA and ECPA are right", "at most 10 % and 100 %"),
    ("fig14", "errors over the speed, with the bound and the published ends", "ECPA alone"),
    ("fig15", "errors over those of the nodes' places", "ECPA alone"),
    ("fig16", "errors over the area of the field", "ECPA alone"),
    ("camera", "targets in the picture of the camera over the delay, with and without prediction", "nothing of it"),
)
"""Name, what it shows, and what the paper has of it."""


def tables(found: Found) -> dict[str, Sequence[Row]]:
    """All tables, by name."""
    return {
        "checks": check_rows(),
        "success": success_rows(found),
        "reasons": reason_rows(found),
        "ablation": ablation_rows(found),
        **sweep_tables(found),
        "sound": sound_rows(found),
        "triggered": triggered_rows(found),
        "messages": message_rows(),
    }


def parts(found: Found) -> list[tuple[str, str]]:
    """All tables, with their headings."""
    every = tables(found)
    return [(title, text(name, every.get(name, ()), found.times)) for name, title in TITLES.items()]


def text(name: str, rows: Sequence[Row], times: Mapping[str, Sequence[float]]) -> str:
    """The part of this name, of its rows or of processor times (s); in Markdown."""
    if name == "costs":
        return costs(times)
    shown = {"checks": _checks, "reasons": reasons, "messages": _messages, **dict.fromkeys(GROUPS, three)}
    return shown.get(name, rows_table)(rows)


def three(rows: Sequence[Row]) -> str:
    """Rows of location, speed and heading, side by side: ours with its interval; then published, prototype, verdict."""
    cases: dict[tuple[str, str], dict[str, Row]] = {}
    for row in rows:
        cases.setdefault((row.case, row.tracker), {})[row.quantity] = row
    names = [quantity(kind) for kind in KINDS]
    body = []
    for (case, tracker), some in cases.items():
        given = [some[name] for name in names]
        refused = given[0].lost
        body.append(
            [
                *(case, tracker),
                *(with_interval(row.ours) for row in given),
                "-" if refused is None else f"{refused.value:.1%}",
                _slashed([row.published for row in given]),
                _slashed([row.prototype for row in given]),
                _verdict(given),
            ]
        )
    return aligned(("case", "solver", *names, "no fix", "published", "prototype", "beside the prototype"), body)


def _slashed(values: Sequence[float | None]) -> str:
    return "-" if None in values else " / ".join(plain(value) for value in values if value is not None)


def _verdict(rows: Sequence[Row]) -> str:
    """One word if all three agree."""
    said = [row.verdict for row in rows]
    return said[0] if len(set(said)) == 1 else " / ".join(said)


def _checks(_: Sequence[Row]) -> str:
    body = [[equation, what, f"{ours:.4g}", f"{published:g}"] for equation, what, ours, published in checks()]
    return aligned(("eq.", "figure", "ours", "published"), body)


def _messages(_: Sequence[Row]) -> str:
    unit = sent()["CPA report"].total
    body = [
        [name, str(one.bytes), str(one.messages), str(one.microphones), str(one.total), plain(one.total / unit)]
        for name, one in sent().items()
    ]
    header = ("way", "bytes of a message", "messages of a node", "microphones", "bytes of a pass", "of CPA reports'")
    return aligned(header, body)
