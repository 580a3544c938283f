"""What ``calibrate rss`` leaves of recorded walks, beside walks that the emulator draws with what was fitted.

    python -m tests.measured_reports FOLDER docs

``FOLDER`` has walk_01.csv, walk_02.csv, walk_03.csv and sensors.csv (``id,x,y,z``). Prints the fragment and the table
of docs/calibration.md, and writes its picture.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np
from scipy.optimize import minimize

from launcher.calibrate.memory import Memory
from launcher.calibrate.picture import draw
from launcher.calibrate.reports import Reports, reports_of
from launcher.calibrate.rss import fitted_rss
from launcher.calibrate.samples import Bools, Floats
from launcher.calibrate.sensors import SensorFit
from trackfield.sensing.complete import Kind
from trackfield.sensing.rss import Rss
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene, Still

SEEDS: Final = range(1, 21)
BEACON_M: Final = 1.2
"""About how high the target carries its beacon."""
LAGS_S: Final = (0.0, 0.5, 1.0, 2.5, 5.0, 10.0, 15.0)
LEVELS: Final = (-78.0, -73.0, -68.0)
_NS: Final = 1e9


def emulated(fit: SensorFit, seed: int) -> Reports:
    """Reports at the instants of the recordings, of a target at the same distances, by sensors of the fitted kind."""
    reports = fit.reports
    own = {id: one.value for id, one in fit.own[1].items()}
    kind = Kind("rss", Rss(offsets=own, **{key: one.value for key, one in fit.fitted.items()}))
    rows = []
    for number, (at, away) in enumerate(zip(_begins(reports), reports.away_m, strict=True)):
        recording, t_ns = int(reports.recording[at]), round(float(reports.t_s[at]) * _NS)
        for sensor, id in enumerate(reports.ids):
            scene = Scene(())
            here = Placed(id, (0.0, 0.0), scene, (), kind, {}, 0.0, 1000 * seed + recording)
            state = (float(away[sensor]), 0.0, 0.0, 0.0)
            reading = replace(here, scene=Still(state)).sample(t_ns)  # type: ignore[arg-type]
            if reading is not None:
                rows.append((recording, sensor, t_ns / _NS, away[sensor], reading.values[0], number))
    recording_, sensor_, t_s, distance, value, instant = np.array(rows).T
    whole = [one.astype(np.int64) for one in (recording_, sensor_)]
    return replace(
        reports,
        recording=whole[0],
        sensor=whole[1],
        t_s=t_s,
        distance_m=distance,
        value=value,
        instant=instant.astype(np.int64),
    )


def _begins(reports: Reports) -> Floats:
    return np.flatnonzero(np.diff(reports.instant, prepend=-1))


def figures(reports: Reports) -> dict[str, float]:
    """What is to be compared: by what is said of it."""
    fit = fitted_rss(reports)
    reports = fit.reports  # without outliers
    off, sensor = fit.residual, reports.sensor
    sd = float(off.std())
    decades = np.column_stack([np.ones(len(off)), np.log10(reports.distance_m)])
    line, *_ = np.linalg.lstsq(decades, reports.value, rcond=None)
    found = {
        "sd of residuals, no offsets, dB": float((reports.value - decades @ line).std()),
        "sd of residuals, dB": sd,
        "nearer than 2 m, dB": float(off[reports.distance_m < 2.0].std()),
        "farther than 12 m, dB": float(off[reports.distance_m > 12.0].std()),
        "skewness": float((off**3).mean() / sd**3),
        "kurtosis, beyond that of a normal variable": float((off**4).mean() / sd**4 - 3.0),
        "more than 2 sd below, %": 100.0 * float((off < -2.0 * sd).mean()),
        "more than 2 sd above, %": 100.0 * float((off > 2.0 * sd).mean()),
        "more than 3 sd off, %": 100.0 * float((np.abs(off) > 3.0 * sd).mean()),
    }
    lags_s, correlation = Memory(reports).correlations(off)
    for lag_s in LAGS_S[1:]:
        near = np.abs(lags_s - lag_s) <= max(0.3, 0.1 * lag_s)
        found[f"correlation {lag_s:g} s apart"] = float(correlation[near].mean())
    found["correlation of two sensors at an instant"] = _together(reports, off) / sd**2
    means = [[off[(sensor == i) & (reports.recording == j)].mean() for j in range(3)] for i in range(len(reports.ids))]
    found["sd of a sensor's mean in one walk, dB"] = float(np.std(means) * np.sqrt(3.0 / 2.0))
    return found | _missing(reports, fit)


def _table(reports: Reports, off: Floats) -> Floats:
    """(instants, sensors), NaN where there is no report; the mean of those that reported twice."""
    shape = reports.away_m.shape
    where = reports.instant * shape[1] + reports.sensor
    count = np.bincount(where, minlength=shape[0] * shape[1])
    with np.errstate(invalid="ignore"):
        return np.reshape(np.bincount(where, off, shape[0] * shape[1]) / count, shape)


def _together(reports: Reports, off: Floats) -> float:
    """The mean product of the residuals of two sensors at one instant."""
    table = np.nan_to_num(_table(reports, off))
    there = reports.heard.astype(float)
    both, products = there.T @ there, table.T @ table
    pairs = np.triu_indices(len(both), 1)
    return float(products[pairs].sum() / both[pairs].sum())


def _missing(reports: Reports, fit: SensorFit) -> dict[str, float]:
    """By the level that is expected, and after a report of the same sensor that was missing."""
    gone, expected = ~reports.heard, _expected(reports, fit)
    edges = [-np.inf, *LEVELS, np.inf]
    found = {"missing, %": 100.0 * float(gone.mean())}
    for low, high in pairwise(edges):
        name = f"above {low:g}" if high == np.inf else f"below {high:g}" if low == -np.inf else f"{low:g} to {high:g}"
        found[f"missing where {name} dBm is expected, %"] = 100.0 * _share(gone, (expected >= low) & (expected < high))
    before = gone[:-1] & (np.diff(reports.recording[_begins(reports)]) == 0)[:, None]
    found["missing after one that was missing, %"] = 100.0 * _share(gone[1:], before)
    return found


def _expected(reports: Reports, fit: SensorFit) -> Floats:
    """(instants, sensors): the level without noise."""
    level = fit.fitted["level_dbm"].value + np.array([one.value for one in fit.own[1].values()])
    found: Floats = level - 10.0 * fit.fitted["exponent"].value * np.log10(reports.away_m)
    return found


def _share(gone: Bools, some: Bools) -> float:
    return float(gone[some].mean()) if some.any() else float("nan")


def heights(reports: Reports, file: Path) -> str:
    """What the fit is with distances in three dimensions."""
    rows = list(csv.DictReader(file.read_text().splitlines()))
    up = {row["id"]: float(row["z"]) - BEACON_M for row in rows}
    z = np.array([up[id] for id in reports.ids])
    tall = replace(reports, distance_m=np.hypot(reports.distance_m, z[reports.sensor]))
    parts = []
    for name, one in (("on the ground", reports), (f"from a beacon at {BEACON_M:g} m", tall)):
        fit = fitted_rss(one)
        level, exponent = fit.fitted["level_dbm"].value, fit.fitted["exponent"].value
        parts.append(
            f"distances {name}: level {level:.2f} dBm, exponent {exponent:.3f}, sd {fit.residual.std():.3f} dB"
        )
    return "\n".join(parts)


def by_level(reports: Reports, fit: SensorFit) -> str:
    """Whether what is missing depends on the level: a logistic model against a share alone."""
    gone, expected = (~reports.heard).ravel(), _expected(reports, fit).ravel()

    def unlikely(line: Floats) -> float:
        odds = line[0] + line[1] * (expected - expected.mean())
        return float(np.sum(np.logaddexp(0.0, odds) - gone * odds))

    share = gone.mean()
    alone = -float(np.sum(np.where(gone, np.log(share), np.log1p(-share))))
    ratio = 2.0 * (alone - float(minimize(unlikely, [-1.5, 0.0], method="Nelder-Mead").fun))
    weakest = reports.value.min()
    return f"missing by level: likelihood ratio {ratio:.1f} for one parameter; the weakest report is {weakest:g} dBm"


def table(recorded: dict[str, float], drawn: Sequence[dict[str, float]]) -> str:
    """A row for each figure: recorded, and the mean over emulated walks with the least and the greatest."""
    lines = ["| | recorded | emulated |", "| --- | ---: | ---: |"]
    for name, value in recorded.items():
        several = [one[name] for one in drawn]
        low, high = min(several), max(several)
        lines.append(f"| {name} | {value:.2f} | {np.mean(several):.2f} ({low:.2f} to {high:.2f}) |")
    return "\n".join(lines)


def main(folder: Path, docs: Path) -> None:
    """Print the fragment and the table, and write ``calibration-rss.png``."""
    sensors = folder / "sensors.csv"
    reports = reports_of([folder / f"walk_0{number}.csv" for number in (1, 2, 3)], sensors)
    fit = fitted_rss(reports)
    print(f"```toml\n{fit.fragment(sensors).toml()}```\n")
    print(f"{heights(reports, sensors)}\n{by_level(reports, fit)}\n")
    print(table(figures(reports), [figures(emulated(fit, seed)) for seed in SEEDS]))
    draw(fit, docs / "calibration-rss.png")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
