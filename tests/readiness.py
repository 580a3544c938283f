"""What was tried to make the default tracker's covariance right: the tables of docs/tracking.md.

    python -m tests.readiness [--runs 50] [--ride bus_304.gpx] [--flight aircraft_survey.csv] [--only NAME ...]
    python -m tests.readiness --mixture
    python -m tests.readiness --where bus_304.gpx

Each row is a tracker, each cell its position error (rms, m) and NEES, which is 4 if its covariance is right: over so
many runs of the paper's targets with the paper's prior on lossless links (seeds 0, 1, ...), 10 runs of the packaged
scenario ``bus``, 2 of it on a longer ride, and 5 of ``radar`` on each leg of a flight (seeds 1, 2, ...). The two
recordings do not come with Trackfield.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.special import gammainc

from launcher.plan.prepare import load, planned
from launcher.record.figures.scores import offsets
from launcher.record.tables import TrackRow
from tests.radar_legs import STRAIGHT, TURNING, ten_minutes_on
from tests.simulated import simulated
from tests.variants import VARIANTS
from tests.zhai_field import MODEL, SCENARIOS, errors, hear, prior_around
from trackfield.filters import imm
from trackfield.filters.gaussian import log_density, root
from trackfield.filters.imm_ukf import ImmUkf
from trackfield.filters.metrics import nees, rmse
from trackfield.filters.trackers import TRACKERS, register_tracker
from trackfield.filters.types import Array, Gaussian
from trackfield.role import NS
from trackfield.world.path import Path as TruePath


class Told(NamedTuple):
    """Errors (n, 4) and NEES (n,) of a tracker where the truth is known, and the shares of steps tracked, by run."""

    errors: Array
    nees: Array
    tracked: tuple[float, ...] = ()

    def __str__(self) -> str:
        share = min(self.tracked, default=1.0)
        lost = "" if share == 1.0 else f", {np.mean(self.tracked):.1%} tracked"
        return (
            f"{rmse(self.errors[:, :2]):,.{2 if rmse(self.errors[:, :2]) < 100 else 0}f}, {self.nees.mean():.2f}{lost}"
        )


def of_the_paper(tracker: ImmUkf, scenario: str, runs: int) -> Told:
    """Its runs with the seeds 0, 1, ..."""
    e, P = errors(tracker, scenario, range(runs))
    return Told(e.reshape(-1, 4), nees(e, P).ravel())


def recorded(trackers: Mapping[str, ImmUkf], scenarios: Iterator[Any]) -> dict[str, Told]:
    """All of them side by side in one run of each scenario."""
    names = {f"variant-{k}": name for k, name in enumerate(trackers)}
    for own, name in names.items():
        register_tracker(own, _maker(trackers[name]))
    found: dict[str, list[tuple[Array, Array, float]]] = {name: [] for name in trackers}
    for scenario in scenarios:
        plan = planned(scenario(tuple(names)))
        rows = simulated(plan)[1]
        for own, name in names.items():
            found[name].append(_judged([row for row in rows if row.point.tracker == own]))
    TRACKERS.registered.clear()
    parts = {name: tuple(zip(*each, strict=True)) for name, each in found.items()}
    return {name: Told(np.concatenate(e), np.concatenate(v), w) for name, (e, v, w) in parts.items()}


def _maker(tracker: ImmUkf) -> Callable[[], ImmUkf]:
    return lambda: tracker


def _judged(rows: list[TrackRow]) -> tuple[Array, Array, float]:
    known = [row for row in rows if row.truth is not None and not row.interpolated]
    kept = [row for row in known if row.has_track]
    e, P = offsets(kept), np.array([row.point.covariance for row in kept]).reshape(-1, 4, 4)
    return e, nees(e, P), len(kept) / len(known)


def rides(file: Path | None, seeds: range) -> Iterator[Any]:
    """The packaged scenario, or of another ride."""
    for seed in seeds:
        yield lambda names, seed=seed: load("bus", seed=seed, target=file, trackers=names)


def flights(file: Path, legs: tuple[str, ...], seeds: range) -> Iterator[Any]:
    """Ten minutes each."""
    for start in legs:
        for seed in seeds:
            given = {"seed": seed, "target": file, "start": start, "end": ten_minutes_on(start)}
            yield lambda names, given=given: load("radar", trackers=names, **given)


def table(trackers: Mapping[str, ImmUkf], runs: int, ride: Path | None, flight: Path | None) -> None:
    """A row for each tracker."""
    columns = {name: {who: of_the_paper(one, name, runs) for who, one in trackers.items()} for name in SCENARIOS}
    columns["bus"] = recorded(trackers, rides(None, range(1, 11)))
    if ride:
        columns["another ride"] = recorded(trackers, rides(ride, range(1, 3)))
    if flight:
        columns["flight, straight"] = recorded(trackers, flights(flight, STRAIGHT, range(1, 6)))
        columns["flight, turns"] = recorded(trackers, flights(flight, TURNING, range(1, 6)))
    print(f"| tracker | {' | '.join(columns)} |\n| --- |{' ---: |' * len(columns)}")
    for who in trackers:
        print(f"| {who} | {' | '.join(str(column[who]) for column in columns.values())} |")
    print(flush=True)


def mixture(trackers: Mapping[str, ImmUkf], runs: int, samples: int = 400) -> None:
    """Whether the truth is inside as often as it should be: of the mixture of all models, and of its one Gaussian.

    And how probable the model of the smallest acceleration is, with the NEES of its own covariance.
    """
    print("| tracker | target | 50 %, 95 % of the mixture | of the Gaussian | NEES | first model | its NEES |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: |")
    for who, tracker in trackers.items():
        for name in SCENARIOS:
            found = np.concatenate([_inside(tracker, name, seed, samples) for seed in range(runs)])
            whole, single, value, likely, own = found.T
            shares = [f"{(each <= 0.5).mean():.0%}, {(each <= 0.95).mean():.0%}" for each in (whole, single)]
            figures = f"{value.mean():.2f} | {likely.mean():.0%} | {own.mean():.2f}"
            print(f"| {who} | {name} | {' | '.join(shares)} | {figures} |", flush=True)


def _inside(tracker: ImmUkf, scenario: str, seed: int, samples: int) -> Array:
    """(T, 5): see ``mixture``; the first two are the probability of all that is likelier than the truth."""
    rng = np.random.default_rng(seed)
    truth, rows = SCENARIOS[scenario](rng), []
    draw = np.random.default_rng([seed, 1])
    state = tracker.init(prior_around(truth[0], rng), MODEL)
    for step, target in enumerate(truth[1:], start=1):
        state, estimate = tracker.step(state, hear(target[:2], rng, step=step), 1.0, rng)
        weights, means, covariances = state.bank
        roots = np.array([root(P) for P in covariances])
        which = draw.choice(len(weights), samples, p=weights)
        points = means[which] + np.einsum("sij,sj->si", roots[which], draw.standard_normal((samples, 4)))
        density = _log_mixture(np.concatenate((target[None], points)), state.bank)
        value = nees(target - estimate.mean, estimate.covariance)
        own = nees(target - means[0], covariances[0])
        single = gammainc(2.0, value / 2.0)  # of chi-square with four degrees of freedom
        rows.append(((density[1:] > density[0]).mean(), single, value, weights[0], own))
    return np.array(rows)


def _log_mixture(points: Array, bank: imm.Bank) -> Array:
    with np.errstate(divide="ignore"):
        each = [log_density(points, Gaussian(m, P)) for m, P in zip(bank.mean, bank.covariance, strict=True)]
        return np.asarray(np.logaddexp.reduce(np.log(bank.probability)[:, None] + np.array(each)))


def where(file: Path) -> None:
    """NEES of the default tracker on a ride (seed 1): by the steps since a gap ended, and by acceleration."""
    plan = planned(load("bus", seed=1, target=file, trackers=("imm-ukf",)))
    (path,) = plan.paths.values()
    rows = [row for row in simulated(plan)[1] if row.has_track and row.truth is not None and not row.interpolated]
    t = np.array([row.t_ns / NS for row in rows])
    values = nees(offsets(rows), np.array([row.point.covariance for row in rows]).reshape(-1, 4, 4))
    ends = np.array([-np.inf, *(end for _, end in path.gaps)])
    since = t - np.array([ends[ends <= at].max() for at in t])
    pushed = np.array([_acceleration(path, at) for at in t])
    print(f"all {len(t)} steps: mean {values.mean():.2f}, median {np.median(values):.2f}")
    parts = {
        "at the end of a gap": since < 0.5,
        "a second later": (since >= 0.5) & (since < 1.5),
        **{
            f"later than three, {low} to {high} m/s^2": (since > 3.5) & (pushed >= low) & (pushed < high)
            for low, high in ((0.0, 0.3), (0.3, 1.0), (1.0, 2.0), (2.0, 20.0))
        },
    }
    for name, these in parts.items():
        print(f"{name}, {these.sum()} steps: mean {values[these].mean():.2f}, median {np.median(values[these]):.2f}")


def _acceleration(path: TruePath, t_s: float) -> float:
    """Of the truth around a time, m/s^2; NaN at its ends."""
    before, after = path.at(t_s - 0.5), path.at(t_s + 0.5)
    return np.nan if before is None or after is None else float(np.hypot(*np.subtract(after[2:], before[2:])))


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--ride", type=Path)
    parser.add_argument("--flight", type=Path)
    parser.add_argument("--only", nargs="*", default=list(VARIANTS), choices=list(VARIANTS))
    parser.add_argument("--where", type=Path, help="only where the NEES on this ride comes from")
    parser.add_argument("--mixture", action="store_true", help="only how the mixture of all models compares")
    given = parser.parse_args()
    if given.where:
        where(given.where)
    elif given.mixture:
        mixture({name: VARIANTS[name] for name in ("one quiet model", "`imm-ukf`")}, given.runs)
    else:
        table({name: VARIANTS[name] for name in given.only}, given.runs, given.ride, given.flight)


if __name__ == "__main__":
    main()
