"""The cost of a step of each filter, a plain numpy loop and other packages' filters on the same data, in Markdown.

    OPENBLAS_NUM_THREADS=1 python -m bench.kernels [--rounds 7]

In each round every filter of a table runs over the whole track, one after the other. Times are medians over the rounds,
and ratios medians of the ratios within a round. Processor time is measured, so other load on the machine matters
little. Packages that are not installed are left out.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np

from bench import bare, peers
from bench.data import DT, Track, track
from bench.scale import machine
from launcher.plan.prepare import load
from launcher.study.studies import study
from trackfield.filters import ekf, ukf
from trackfield.filters.bootstrap import Bootstrap
from trackfield.filters.fa_upf import FaUpf
from trackfield.filters.gaussian import constant_velocity, predict
from trackfield.filters.gpf_ukf import GpfUkf
from trackfield.filters.jm_rbpf import JmRbpf
from trackfield.filters.single_model import Ekf, Ukf
from trackfield.filters.spcpf import SpCpf
from trackfield.filters.trackers import TRACKERS
from trackfield.filters.types import Array, Gaussian, Reports, Tracker
from trackfield.filters.upf import Upf
from trackfield.models import doa
from trackfield.models.doa import wrap

SIZES: Final = (200, 1_000, 10_000)
BARE: Final = "bare numpy"
OURS: Final = "trackfield"
SLOW_STEPS: Final = 10
"""Of a filter that takes long."""
TURN_S: Final = 0.05
"""The shortest run of a filter in a round, as shorter processor times are coarse."""

Contender = Callable[[], Array]


class Row(NamedTuple):
    """A filter's ``us`` for a step, how much that is of the first one's, and its rms position error (m)."""

    who: str
    us: float
    ratio: float
    error_m: float


# --- contenders: called, each runs over the track and returns the means (T, 4) ----------------------------------------


def tracked(data: Track, tracker: Tracker[Any], seed: int = 1) -> Contender:
    """One of our trackers, with a generator as the bare loop has it."""
    reports = data.reports

    def run() -> Array:
        rng, state, means = np.random.default_rng(seed), tracker.init(data.prior, data.model), []
        for one in reports:
            state, estimate = tracker.step(state, one, DT, rng)
            means.append(estimate.mean)
        return np.array(means)

    return run


def looped(data: Track, make: Callable[[], Any]) -> Contender:
    """A filter of ``bench.bare``; of several at once the first."""

    def run() -> Array:
        one = make()
        means = [one.step(*given) for given in zip(data.sensors, data.bearings, strict=True)]
        return np.array([mean[0] if mean.ndim > 1 else mean for mean in means])

    return run


Take = Callable[[Gaussian, Reports, float], Gaussian]


def take_ekf(belief: Gaussian, reports: Reports, sigma_w: float) -> Gaussian:
    """The kernel of the tracker ``ekf``."""
    places = reports.positions
    measure, slopes = partial(doa.measure, sensors=places), partial(doa.jacobian, sensors=places)
    return ekf.posterior(belief, reports.bearings, sigma_w, measure, slopes, wrap)


def take_ukf(belief: Gaussian, reports: Reports, sigma_w: float) -> Gaussian:
    """The kernel of the tracker ``ukf``."""
    return ukf.posterior(belief, reports.bearings, sigma_w, partial(doa.measure, sensors=reports.positions), wrap)


def alone(data: Track, take: Take) -> Contender:
    """One filter by its kernels alone, without a tracker around them."""
    reports, motion = data.reports, constant_velocity(DT, data.model.sigma_v)

    def run() -> Array:
        belief, means = data.prior, []
        for one in reports:
            belief = take(predict(belief, motion), one, data.model.sigma_w)
            means.append(belief.mean)
        return np.array(means)

    return run


def batched(data: Track, take: Take, n: int) -> Contender:
    """``n`` filters at once, as studies use the kernels."""
    reports, motion = data.reports, constant_velocity(DT, data.model.sigma_v)

    def run() -> Array:
        belief = Gaussian(np.tile(data.prior.mean, (n, 1)), np.tile(data.prior.covariance, (n, 1, 1)))
        means = []
        for one in reports:
            belief = take(predict(belief, motion), one, data.model.sigma_w)
            means.append(belief.mean[0])
        return np.array(means)

    return run


# --- measuring --------------------------------------------------------------------------------------------------------


def measured(data: Track, contenders: Mapping[str, Contender], rounds: int) -> list[Row]:
    """All contenders in turn, ``rounds`` times, after two warm-up runs each; quick ones run several times per turn."""
    errors = {who: data_error(data, run()) for who, run in contenders.items()}
    times = {who: max(1, round(TURN_S / seconds(run, 1))) for who, run in contenders.items()}
    taken: dict[str, list[float]] = {who: [] for who in contenders}
    for _ in range(rounds):
        for who, run in contenders.items():
            taken[who].append(seconds(run, times[who]) / len(data.truth) * 1e6)
    first = np.array(next(iter(taken.values())))
    return [
        Row(who, float(np.median(us)), float(np.median(np.array(us) / first)), errors[who]) for who, us in taken.items()
    ]


def seconds(run: Contender, times: int) -> float:
    """Processor time of one run, averaged over ``times`` runs."""
    begun = time.process_time()
    for _ in range(times):
        run()
    return (time.process_time() - begun) / times


def data_error(data: Track, means: Array) -> float:
    """Root mean square (m) of the positions' errors over the track."""
    return float(np.sqrt(np.square(means[:, :2] - data.truth[:, :2]).sum(axis=1).mean()))


def with_peers(own: Mapping[str, Contender], others: Mapping[str, Callable[[], Contender]]) -> dict[str, Contender]:
    """Trackfield's filters and those of installed packages; missing packages are named on stderr."""
    found = dict(own)
    for who, make in others.items():
        try:
            found[who] = make()
            found[who]()
        except ImportError as error:
            print(f"left out: {who} is not installed ({error})", file=sys.stderr)
            found.pop(who, None)
    return found


# --- tables -----------------------------------------------------------------------------------------------------------


def particle_filters(data: Track, n: int) -> dict[str, Contender]:
    """Bootstrap filters of ``n`` particles."""
    own = {
        BARE: looped(data, lambda: bare.Bootstrap(data, n, np.random.default_rng(1))),
        OURS: tracked(data, Bootstrap(n)),
    }
    others = {
        "particles": partial(peers.particles_bootstrap, data, n),
        "Stone Soup": partial(peers.stonesoup_particles, data, n),
    }
    return with_peers(own, others)


def unscented_particle_filters(data: Track) -> dict[str, Contender]:
    """Those of Zhou et al. (2011), beside a bootstrap filter of as many particles as they compare with.

    First the bare loop of that, which the others' ratios are to.
    """
    return {
        f"{BARE}, bootstrap 1,000": looped(data, lambda: bare.Bootstrap(data, 1_000, np.random.default_rng(1))),
        "bootstrap, 1,000": tracked(data, Bootstrap(1_000)),
        "UPF, 200": tracked(data, Upf(200)),
        "FA-UPF, 200": tracked(data, FaUpf(200)),
        "GPF-UKF, 100": tracked(data, GpfUkf(100)),
    }


def proposals(data: Track) -> dict[str, Contender]:
    """Particles that are drawn from a Kalman filter of their own; over the first steps only, as the other is slow."""
    few = data.first(SLOW_STEPS)
    others = {"Stone Soup": partial(peers.stonesoup_proposal, few, 200)}
    return with_peers({OURS: tracked(few, Upf(200))}, others)


def turning_filters(data: Track, n: int = 500) -> dict[str, Contender]:
    """What modes of motion and Gaussian velocities cost."""
    return {"bootstrap": tracked(data, Bootstrap(n)), "JM-RBPF": tracked(data, JmRbpf(n))}


def kalman_filters(data: Track, kind: str) -> dict[str, Contender]:
    """One EKF, or one UKF."""
    extended = kind == "EKF"
    make = bare.Ekf if extended else bare.Ukf
    own = {
        BARE: looped(data, lambda: make(data, 1)),
        OURS: tracked(data, Ekf() if extended else Ukf()),
        f"{OURS}, its kernels alone": alone(data, take_ekf if extended else take_ukf),
    }
    others = {
        "filterpy": partial(peers.filterpy_ekf if extended else peers.filterpy_ukf, data),
        "Stone Soup": partial(peers.stonesoup_kalman, data, "Extended" if extended else "Unscented"),
    }
    return with_peers(own, others)


def table(head: str, groups: Mapping[str, Sequence[Row]]) -> str:
    """In Markdown, a row for each contender of each group."""
    lines = [f"| {head} | by | us per step | / first | error m |", "| --- | --- | ---: | ---: | ---: |"]
    for group, rows in groups.items():
        lines += [f"| {group} | {r.who} | {r.us:,.0f} | {r.ratio:.2f} | {r.error_m:.2f} |" for r in rows]
    return "\n".join(lines)


def hundred_runs() -> tuple[float, float]:
    """Seconds by the clock and of the processors, of 100 virtual runs of s1 with all trackers, over all cores."""
    scenario = load("zhai-spcpf", trackers=list(TRACKERS))
    begun = time.perf_counter()
    runs = study(scenario, range(1, 101)).results
    wall = time.perf_counter() - begun
    return wall, sum(run.metrics.cpu_s or 0.0 for run in runs)


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=7)
    rounds, data = parser.parse_args().rounds, track()
    print(f"A step of one filter ({machine()}):\n")
    groups = {f"bootstrap, N={n:,}": measured(data, particle_filters(data, n), rounds) for n in SIZES}
    groups |= {kind: measured(data, kalman_filters(data, kind), rounds) for kind in ("EKF", "UKF")}
    print(table("filter", groups), end="\n\n", flush=True)
    print("A step of many filters at once:\n")
    kernels = {"EKF": (bare.Ekf, take_ekf), "UKF": (bare.Ukf, take_ukf)}
    batches = {
        f"{kind}, {n:,} at once": {BARE: looped(data, partial(make, data, n)), OURS: batched(data, take, n)}
        for kind, (make, take) in kernels.items()
        for n in SIZES
    }
    print(
        table("filters", {name: measured(data, both, rounds) for name, both in batches.items()}), end="\n\n", flush=True
    )
    paper = {"bootstrap, 2,000": tracked(data, Bootstrap(2_000)), "SP-CPF, 200 and 15": tracked(data, SpCpf(200, 15))}
    print(f"The paper's two:\n\n{table('filter', {'s1': measured(data, paper, rounds)})}\n", flush=True)
    turning = {"s1": measured(data, turning_filters(data), rounds)}
    print(f"With turns:\n\n{table('filter', turning)}\n", flush=True)
    unscented = {"s1": measured(data, unscented_particle_filters(data), rounds)}
    print(f"Unscented particle filters:\n\n{table('filter', unscented)}\n", flush=True)
    one = {f"UPF, N=200, {SLOW_STEPS} steps": measured(data.first(SLOW_STEPS), proposals(data), min(rounds, 3))}
    print(f"The same by another package:\n\n{table('filter', one)}\n", flush=True)
    wall_s, cpu_s = hundred_runs()
    print(
        f"100 virtual runs of s1, {len(TRACKERS)} trackers: {wall_s:.0f} s, {cpu_s:.0f} s of processors ({machine()})"
    )


if __name__ == "__main__":
    main()
