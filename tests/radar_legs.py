"""How well one radar follows an aircraft, leg by leg: the tables of docs/radar.md.

    python -m tests.radar_legs ../shared/data/aircraft_survey.csv [--runs 20]

Each row is so many virtual runs of the packaged scenario on ten minutes of the track, with seeds from 1 on: another
seed is another prior and other noise.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from launcher.plan.prepare import load
from launcher.study.studies import study

STRAIGHT: Final = (
    *("15:03", "15:17", "15:31", "15:47", "16:02", "16:19", "16:36", "16:52"),
    *("17:09", "17:25", "17:41", "17:59", "18:15", "18:31", "18:47"),
)
"""When the aircraft flies straight for ten minutes: north and south in turn, along all lines of its survey."""
TURNING: Final = ("14:50", "15:08", "15:23")
"""With several turns, with one of 180 degrees near the end, and with one in the middle."""
BESIDE: Final = ("predict-only", "ekf", "bootstrap", "spcpf")


class Leg(NamedTuple):
    """What came of a leg: rms errors (m) over all runs by tracker, the median run of the first tracker, the bound."""

    start: str
    error: dict[str, float]
    median: float
    bound: float

    @property
    def default(self) -> float:
        """The error of the first tracker."""
        return next(iter(self.error.values()))

    @property
    def share(self) -> float:
        """The default tracker's error as a share of what comes of predicting alone."""
        return self.default / self.error["predict-only"]


def leg(file: Path, start: str, runs: int, n_jobs: int = -1) -> Leg:
    """Ten minutes from ``start``, with ``n_jobs`` as of ``study``. Raises ``ScenarioError`` if the file has none."""
    scenario = load("radar", target=file, start=start, end=ten_minutes_on(start))
    results = study(scenario, range(1, runs + 1), n_jobs=n_jobs).results
    names = scenario.fusion.trackers
    found = {name: np.array([run.metrics.trackers[name].rmse.position for run in results], float) for name in names}
    bounds = np.array([run.metrics.bound.trajectory for run in results], float)
    return Leg(start, {n: _rms(e) for n, e in found.items()}, float(np.median(found[names[0]])), _rms(bounds))


def ten_minutes_on(start: str) -> str:
    """The time of day ten minutes after ``start``, both HH:MM."""
    hour, minute = map(int, start.split(":"))
    hours, minutes = divmod(60 * hour + minute + 10, 60)
    return f"{hours:02}:{minutes:02}"


def _rms(values: Any) -> float:
    return float(np.sqrt(np.square(values).mean()))


def table(legs: Iterable[Leg]) -> str:
    """In Markdown."""
    heads = ("from", "bound", "default", "/ bound", "median run", "/ predict-only", *BESIDE)
    lines: list[Sequence[str]] = [heads, ["---:"] * len(heads)]
    for one in legs:
        figures = (one.bound, one.default, one.default / one.bound, one.median, one.share)
        others = [f"{one.error[name]:,.0f}" for name in BESIDE]
        bound, error, ratio, median, share = figures
        lines.append(
            (one.start, f"{bound:,.0f}", f"{error:,.0f}", f"{ratio:.2f}", f"{median:,.0f}", f"{share:.2f}", *others)
        )
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--runs", type=int, default=20)
    asked = parser.parse_args()
    straight = [leg(asked.file, start, asked.runs) for start in STRAIGHT]
    print(f"Straight:\n\n{table(straight)}\n")
    shares = sorted(one.share for one in straight)
    print(
        f"default / predict-only: median {np.median(shares):.2f}, at most 0.5 on {sum(s <= 0.5 for s in shares)} legs;"
    )
    print(f"default / bound: median {np.median([one.default / one.bound for one in straight]):.2f}\n")
    print(f"With turns:\n\n{table(leg(asked.file, start, asked.runs) for start in TURNING)}")


if __name__ == "__main__":
    main()
