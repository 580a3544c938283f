"""The study of Zhai et al. (2009) in words: its parts in their order, and what the figures show."""

from __future__ import annotations

from typing import Final

from launcher.reproduce.papers.zhai.tables import RADAR_SHARE, tables, thresholds
from launcher.reproduce.scores import Results, Score
from launcher.reproduce.tables import FACTOR, aligned, rows_table

TITLES: Final = {
    "table I": f"Table I: published and ours in s1, 75 % (a figure within a factor of {FACTOR:g} is *as published*)",
    "costs": "What trackers cost, in s1",
    "scenarios": "Scenarios 1 to 3, 75 %",
    "thresholds": "Thresholds",
    "network": "Reports, frames and energy",
    "nominals": "Filters in the bank, N, in s1",
    "particles": "Particles, Ns, in s1",
    "radar": f"One radar (with bearings at most {RADAR_SHARE:g} of what predicting alone leaves)",
    "causes": "What the bootstrap's errors are due to: its prior in s1, its model in s2 and s3",
}
"""Of the parts of the report, in their order."""

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


def parts(results: Results[Score]) -> list[tuple[str, str]]:
    """All tables, with their headings."""
    texts = {name: rows_table(rows) for name, rows in tables(results).items()}
    texts |= {"costs": _costs(results), "network": _network(results)}
    return [(title, texts[name]) for name, title in TITLES.items()]


def _network(results: Results[Score]) -> str:
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


def _costs(results: Results[Score]) -> str:
    rows = [
        [name, f"{1e3 * time_s:.1f}", f"{time_s / results.times['bootstrap']:.2f}"]
        for name, time_s in results.times.items()
    ]
    return aligned(("tracker", "processor time of a run, ms", "over bootstrap's"), rows)
