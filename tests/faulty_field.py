"""The paper's field with one faulty sensor: ``python -m tests.faulty_field`` prints the table of docs/tracking.md.

``--sensor 12`` makes another sensor than n060 faulty, ``--prior`` starts the tracks from the paper's prior. Paths that
are named are the only ones.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import cache

import numpy as np

from tests.zhai_field import GRID, MODEL, SCENARIOS, THRESHOLD_DB, hear, prior_around
from trackfield.filters.imm_ukf import ImmUkf
from trackfield.filters.metrics import rmse
from trackfield.filters.types import Array, Reports, of_bearings
from trackfield.tracking.following import Following

FAULTY = 60
"""n060 stands in the middle of the field, at (250, 250) m; s1 passes it at 8 m."""

LOST_M = 50.0

KINDS = ("none", "stuck", "bias", "deaf", "babble", "clock_jump")


def without(reports: Reports, sensor: int) -> Reports:
    """The reports of all others."""
    return reports.only(np.array([i for i, id in enumerate(reports.sensors) if id != f"n{sensor:03d}"], dtype=int))


def instead(reports: Reports, sensor: int, bearing: float, level: float) -> Reports:
    """The reports with this one in place of what the sensor heard, if anything."""
    rest = without(reports, sensor)
    return of_bearings(
        rest.step,
        (*rest.sensors, f"n{sensor:03d}"),
        np.concatenate((rest.positions, GRID[[sensor]])),
        np.append(rest.bearings, bearing),
        np.append(rest.levels, level),
    )


def spoilt(kind: str, heard: Sequence[Reports], sensor: int, rng: np.random.Generator) -> list[Reports]:
    """What reaches the centre of the reports of all steps when ``sensor`` has this fault all the time."""
    stuck = rng.uniform(-np.pi, np.pi)

    def reading(step: int) -> tuple[float, float] | None:
        own = [i for i, id in enumerate(heard[step].sensors) if id == f"n{sensor:03d}"] if step >= 0 else []
        return (float(heard[step].bearings[own[0]]), float(heard[step].levels[own[0]])) if own else None

    def told(step: int) -> tuple[float, float] | None:
        match kind:
            case "stuck":
                return stuck, THRESHOLD_DB + 3.0
            case "babble":
                return rng.uniform(-np.pi, np.pi), THRESHOLD_DB + rng.uniform(0.0, 10.0)
            case "deaf":
                return None
            case "clock_jump":  # a second ahead: what it hears in a step it reports for the next
                return reading(step - 1)
        true = reading(step)
        return (true[0] + np.radians(20.0), true[1]) if true and kind == "bias" else true

    tellings = [told(step) for step in range(len(heard))]
    return [
        without(reports, sensor) if telling is None else instead(reports, sensor, *telling)
        for reports, telling in zip(heard, tellings, strict=True)
    ]


@cache
def errors(
    scenario: str, kind: str, runs: int, *, gate: bool = True, prior: bool = False, sensor: int = FAULTY
) -> Array:
    """Position errors (runs, T, 2) of the default tracker; nan where there is no track."""
    return np.array([_errors(scenario, kind, seed, gate, prior, sensor) for seed in range(runs)])


def _errors(scenario: str, kind: str, seed: int, gate: bool, prior: bool, sensor: int) -> Array:
    rng = np.random.default_rng(seed)
    truth = SCENARIOS[scenario](rng)
    one = Following(ImmUkf(gate=gate), MODEL)
    state, places = one.begin(prior_around(truth[0], rng) if prior else None), []
    heard = [hear(target[:2], rng, step=step) for step, target in enumerate(truth[1:], start=1)]
    if kind != "none":
        heard = spoilt(kind, heard, sensor, np.random.default_rng([seed, 1]))
    for reports in heard:
        state, estimate = one.step(state, reports, 1.0, rng)
        places.append(np.full(2, np.nan) if estimate is None else estimate.mean[:2])
    return np.array(places) - truth[1:, :2]


def main() -> None:
    """A row for each fault: rms error, and the largest, with the gate and without it; then which runs were lost."""
    parser = argparse.ArgumentParser()
    parser.add_argument("paths", nargs="*", default=list(SCENARIOS))
    parser.add_argument("--sensor", type=int, default=FAULTY)
    parser.add_argument("--prior", action="store_true")
    asked = parser.parse_args()
    lost = []
    for kind in KINDS:
        cells = []
        for scenario in asked.paths:
            for gate in (True, False):
                e = errors(scenario, kind, 20, gate=gate, prior=asked.prior, sensor=asked.sensor)
                known = np.isfinite(e[..., 0])
                cells.append(f"{rmse(e[known]):.2f} ({np.linalg.norm(e[known], axis=-1).max():.0f})")
                if count := int(np.sum(~(np.linalg.norm(e[:, -1], axis=-1) <= LOST_M))):
                    lost.append(f"{kind}, {scenario}, {'gate' if gate else 'none'}: {count} of 20 lost")
        print(f"| {kind} | " + " | ".join(cells) + " |", flush=True)
    print("\n".join(lost))


if __name__ == "__main__":
    main()
