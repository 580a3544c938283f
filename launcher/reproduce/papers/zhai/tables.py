"""Zhai, Yeary, Havlicek & Fan, "A New Centralized Sensor Fusion-Tracking Methodology Based on Particle Filtering for
Power-Aware Systems", IEEE Trans. Instrum. Meas. 2009: its tables beside ours.

Every verdict is computed from figures and a band that is stated beside it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from launcher.reproduce.intervals import Interval
from launcher.reproduce.papers.zhai.cases import (
    ALL,
    CASES,
    MAIN,
    NOMINALS,
    PARTICLES,
    SINGLE,
    TENTH,
    nominals,
    particles,
)
from launcher.reproduce.papers.zhai.contrasts import TIME
from launcher.reproduce.scores import Results, Score
from launcher.reproduce.tables import Band, Row, beside, inside

TABLE_1: Final[Mapping[str, Mapping[str, float]]] = {
    "spcpf": {"mean_x": 1.909, "var_x": 1.693, "mean_y": 4.004, "var_y": 6.978, "time": 2.161},
    "bootstrap": {"mean_x": 23.180, "var_x": 154.63, "mean_y": 30.060, "var_y": 223.291, "time": 8.109},
}
"""The paper's Table I: metres, square metres, seconds."""

FEW_LOST: Final = 0.05
"""The limit where no run should be lost: no number of runs shows a share of 0; a hundred without a loss show this."""
BANDS: Final[Mapping[tuple[str, str], Mapping[str, Band]]] = {
    ("s1", "spcpf"): {"position": Band(0, 1.7), "lost": Band(0, FEW_LOST)},
    ("s2", "spcpf"): {"position": Band(0, 3.0), "lost": Band(0, FEW_LOST)},
    ("s3", "spcpf"): {"position": Band(0, 2.6), "lost": Band(0, FEW_LOST)},
    ("s1", "bootstrap"): {"median_run": Band(4.5, 9.0), "lost": Band(0.03, 0.15)},
    ("s2", "bootstrap"): {"lost": Band(0.8, 1)},
    ("s3", "bootstrap"): {"lost": Band(0.8, 1)},
    ("s1", "fix-imm-ukf"): {"position": Band(0, 1.15)},
    ("s2", "fix-imm-ukf"): {"position": Band(0, 2.0)},
    ("s3", "fix-imm-ukf"): {"position": Band(0, 1.95)},
}
"""For fields of ``Score``, by case and tracker: what an independent implementation reached, with a margin."""
RADAR_SHARE: Final = 0.5
"""With bearings, a tracker's error should be at most this share of what predicting alone leaves."""


def tables(results: Results[Score]) -> dict[str, list[Row]]:
    """Everything that the paper measures, by table."""
    paths = ("s1", "s2", "s3")
    filters = (*map(particles, PARTICLES), *TENTH, "bootstrap")
    rivals = ("spcpf", "bootstrap", *TENTH)
    compared = ("spcpf", *SINGLE, *MAIN[1:])
    causes = ("s1", "s1-narrow", "s2", "s2-agile", "s3", "s3-agile")
    return {
        "table I": list(_table_1(results)),
        "scenarios": [_position(results, case, name, BANDS.get((case, name))) for case in paths for name in ALL],
        "thresholds": [
            _position(results, case, name) for case in thresholds() for name in compared if name in CASES[case].trackers
        ],
        "nominals": [_position(results, "s1", nominals(n)) for n in NOMINALS],
        "particles": [_position(results, "s1", name) for name in filters],
        "radar": [_radar(results, name) for name in CASES["radar"].trackers],
        "causes": [
            _position(results, case, name) for case in causes for name in rivals if name in CASES[case].trackers
        ],
    }


def thresholds() -> list[str]:
    """The cases that differ by the sensors' threshold, path by path."""
    names = (f"{path}{share}" for path in ("s1", "s2", "s3") for share in ("-72", "", "-78", "-79"))
    return [name for name in names if name in CASES]


def _table_1(results: Results[Score]) -> Iterator[Row]:
    units = {"mean_x": "mean of RMSE x, m", "var_x": "variance of RMSE x, m²"}
    units |= {"mean_y": "mean of RMSE y, m", "var_y": "variance of RMSE y, m²"}
    for tracker, published in TABLE_1.items():
        for name, unit in units.items():
            score = results.scores["s1"][tracker]
            ours = score.interval(name)
            ratio = ours.over(published[name])
            median = score.interval(name.replace("mean", "median")) if name.startswith("mean") else None
            lost = None if median is None else score.interval("lost")
            yield Row("s1", tracker, unit, ours, published[name], ratio, median, lost, verdict=beside(ratio))
        ours = _alone(results.times[tracker])
        yield Row("s1", tracker, "processor time, s", ours, published["time"], ours.over(published["time"]))
    ours, published_ratio = results.contrasts[TIME], time_ratio({name: row["time"] for name, row in TABLE_1.items()})
    cheaper = Band(0, 1)
    yield Row(
        "s1",
        "spcpf",
        "time over bootstrap's",
        ours,
        published_ratio,
        ours.over(published_ratio),
        band=str(cheaper),
        verdict=inside([ours], [cheaper]),
    )


def _alone(value: float) -> Interval:
    """A figure without an interval: of one run, or of a machine."""
    return Interval(value, None, None)


def time_ratio(times: Mapping[str, float]) -> float:
    """The processor time of SP-CPF over that of the bootstrap."""
    return times["spcpf"] / times["bootstrap"]


def _position(results: Results[Score], case: str, tracker: str, bands: Mapping[str, Band] | None = None) -> Row:
    """The position error, judged by its bands."""
    score, bound = results.scores[case][tracker], results.fields[case].bound
    judged = bands or {}
    return Row(
        case,
        tracker,
        "position, m",
        score.interval("position"),
        median_run=score.interval("median_run"),
        lost=None if case == "radar" else score.interval("lost"),
        bound=bound,
        to_bound=None if bound is None else score.position / bound,
        band=", ".join(f"{name.replace('_', ' ')} {band}" for name, band in judged.items()),
        verdict=inside([score.interval(name) for name in judged], list(judged.values())),
    )


def _radar(results: Results[Score], tracker: str) -> Row:
    alone = results.scores["radar"]["predict-only"].position
    useful = {"position": Band(0, RADAR_SHARE * alone)} if tracker in ("ekf", "ukf", "bootstrap") else None
    return _position(results, "radar", tracker, useful)
