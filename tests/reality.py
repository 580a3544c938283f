"""Whether the emulator predicts the field: errors on real reports beside those on emulated ones of the same walk.

    python -m tests.reality [--emulated 200] [--real 50] [--jobs 2]
    python -m tests.reality --walk walk_01.csv --sensor rss.toml

The packaged scenario ``hall`` plays what real receivers reported. It is run under several seeds, of which trackers with
particles draw differently; and with ``sensor.play = "times"``, where readings are drawn by the calibrated model, under
others.

In the first table each row is a setting that both kinds of run have; trackers go by the noise that it says. In the
second one the noise is as calibrated, and trackers take it to be so many times as large; it is over a quarter of the
seeds. With ``--walk`` it is another recording by the same receivers, with the section ``[sensor]`` of another
calibration, and one row for each tracker.
"""

from __future__ import annotations

import argparse
import sys
import tomllib
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from launcher.plan.prepare import planned
from launcher.record.figures.scores import offsets
from tests.simulated import simulated
from trackfield.filters.metrics import nees, rmse
from trackfield.scenario import Scenario

TRACKERS: Final = ("imm-ukf", "ukf", "bootstrap")
FIRST_EMULATED: Final = 1001
"""The first seed of emulated runs."""
ASSUMED: Final = (1.0, 1.25, 1.5, 2.0)
"""``fusion.assumed_noise`` in the second table."""


def settings() -> dict[str, dict[str, Any]]:
    """What is changed in the scenario, by what is said of it."""
    sensor = Scenario.load("hall").plain()["sensor"]
    offsets = float(np.square(list(sensor["offsets"].values())).mean())
    own = sensor["shadow_sd_db"] ** 2
    unknown = {"offsets": {}, "shadow_sd_db": (own + offsets) ** 0.5, "fixed": offsets / (own + offsets)}
    return {
        "as calibrated": {},
        "all noise independent": {"sensor.slow": 0.0},
        "offsets not known": {f"sensor.{key}": value for key, value in unknown.items()}
        | {"sensor.slow": sensor["slow"] * own / (own + offsets)},
        "as calibrated, tracks begin at up to 10 m/s": {"fusion.speed_sd": 10.0},
    }


class Scores(NamedTuple):
    """Of a run, or of several along the first axis: ``rmse`` (m), and the mean NEES of all, position and velocity."""

    rmse: Any
    whole: Any
    position: Any
    velocity: Any


def scored(changes: Mapping[str, Any], seed: int) -> dict[str, Scores]:
    """The scores of each tracker in a run."""
    plan = planned(Scenario.load("hall", {"fusion.trackers": list(TRACKERS), **changes, "seed": seed}))
    _, rows = simulated(plan)
    found = {}
    for name in TRACKERS:
        known = [row for row in rows if row.point.tracker == name and row.has_track and row.truth is not None]
        off, covariance = offsets(known), np.array([row.point.covariance for row in known]).reshape(-1, 4, 4)
        parts = (slice(None), slice(0, 2), slice(2, 4))
        found[name] = Scores(rmse(off[:, :2]), *(nees(off[:, one], covariance[:, one, one]).mean() for one in parts))
    return found


class Beside(NamedTuple):
    """The scores of emulated and of real runs by tracker."""

    predicted: dict[str, Scores]
    real: dict[str, Scores]


def beside(pool: ProcessPoolExecutor, changes: Mapping[str, Any], emulated: int, real: int) -> Beside:
    """So many emulated runs and so many of the trackers' draws on what was really reported."""
    drawn = range(FIRST_EMULATED, FIRST_EMULATED + emulated)
    return Beside(_runs(pool, {**changes, "sensor.play": "times"}, drawn), _runs(pool, changes, range(1, real + 1)))


def _runs(pool: ProcessPoolExecutor, changes: Mapping[str, Any], seeds: Sequence[int]) -> dict[str, Scores]:
    found = list(pool.map(partial(scored, changes), seeds))
    return {name: Scores(*np.array([one[name] for one in found]).T) for name in TRACKERS}


def errors(pool: ProcessPoolExecutor, settings: Mapping[str, Any], emulated: int, real: int) -> list[str]:
    """The first table: errors by setting."""
    lines = [
        "| setting | tracker | predicted [m] | real [m] | predicted / real | NEES predicted | NEES real |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for setting, changes in settings.items():
        found = beside(pool, changes, emulated, real)
        for name in TRACKERS:
            predicted, there = found.predicted[name], found.real[name]
            low, middle, high = np.quantile(predicted.rmse, [0.1, 0.5, 0.9])
            error = float(np.mean(there.rmse))
            spread = f"{middle:.2f} ({low:.2f} to {high:.2f})"
            sure = f"{np.median(predicted.whole):.1f} | {np.median(there.whole):.1f}"
            lines.append(f"| {setting} | `{name}` | {spread} | {error:.2f} | {middle / error:.2f} | {sure} |")
    return lines


def honesty(pool: ProcessPoolExecutor, emulated: int, real: int) -> list[str]:
    """The second table: errors and NEES by the noise that trackers assume."""
    lines = [
        "| tracker | assumed noise | RMSE predicted [m] | real [m] | NEES of position predicted | real | of velocity "
        "predicted | real |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    found = {one: beside(pool, {"fusion.assumed_noise": one}, emulated, real) for one in ASSUMED}
    for name in TRACKERS:
        for one, (predicted, there) in found.items():
            pairs = zip(predicted[name], there[name], strict=True)
            error, _, position, velocity = ([f"{np.median(each):.2f}" for each in pair] for pair in pairs)
            lines.append(f"| `{name}` | {one:g} | {' | '.join((*error, *position, *velocity))} |")
    return lines


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--walk", default="", help="a recording in place of the packaged one")
    parser.add_argument("--sensor", type=Path, help="what calibrate rss wrote for it")
    parser.add_argument("--emulated", type=int, default=200)
    parser.add_argument("--real", type=int, default=50)
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    with ProcessPoolExecutor(asked.jobs) as pool:
        if asked.walk:
            sensor = tomllib.loads(asked.sensor.read_text())["sensor"] | {"recording": asked.walk}
            own = {Path(asked.walk).name: {f"sensor.{key}": value for key, value in sensor.items()}}
            print("\n".join(errors(pool, own, asked.emulated, asked.real)))
            return 0
        print("\n".join(errors(pool, settings(), asked.emulated, asked.real)), flush=True)
        print("\n" + "\n".join(honesty(pool, max(asked.emulated // 4, 1), max(asked.real // 4, 1))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
