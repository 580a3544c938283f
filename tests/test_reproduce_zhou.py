"""The experiments of Zhou et al. (2011): their field, targets and readings, and what is said of their figures."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from launcher.reproduce.kernels.command import reproduce_kernels
from launcher.reproduce.kernels.draws import generators
from launcher.reproduce.kernels.study import Experiment, Found
from launcher.reproduce.papers.zhou import KERNELS
from launcher.reproduce.papers.zhou.claims import JUDGES, TO_BOUND, claims
from launcher.reproduce.papers.zhou.converted import converted
from launcher.reproduce.papers.zhou.costs import needed, particles_over
from launcher.reproduce.papers.zhou.experiments import EXPERIMENTS, FILTERS, SWEEPS, informations, nees, swept
from launcher.reproduce.papers.zhou.figures import logarithmic
from launcher.reproduce.papers.zhou.filters import bootstrap
from launcher.reproduce.papers.zhou.setups import (
    ORIGIN,
    OUTLIERS,
    RSS,
    SETUPS,
    WALK,
    Setup,
    cluster,
    jitter,
    neighbours,
    paths,
    world,
)
from launcher.reproduce.papers.zhou.tables import BOUNDS, bound
from launcher.reproduce.tables import UNKNOWN
from trackfield.filters.bootstrap import Bootstrap
from trackfield.filters.recovery import alone
from trackfield.filters.rng import generator

# --- field, targets, readings -----------------------------------------------------------------------------------------


def test_a_node_is_anywhere_in_its_cell_and_always_at_the_same_place() -> None:
    cells = np.stack(np.meshgrid(np.arange(-150, 150), np.arange(-150, 150)), axis=-1)
    at = jitter(np.array(7), cells)
    assert np.array_equal(at[3:5], jitter(np.array(7), cells[3:5]))
    other = jitter(np.array(8), cells)
    assert 0.0 <= at.min() < at.max() < 1.0
    # of 90,000 uniform draws the mean is within 0.004 of 1/2, and a correlation within 0.013 of 0: four sds
    assert at.mean(axis=(0, 1)) == pytest.approx(0.5, abs=0.004)
    pairs = ((at[..., 0], at[..., 1]), (at[1:, :, 0], at[:-1, :, 0]), (at[:, 1:, 1], at[:, :-1, 1]), (at, other))
    for a, b in pairs:
        assert np.corrcoef(a.ravel(), b.ravel())[0, 1] == pytest.approx(0.0, abs=0.014)


@pytest.mark.parametrize("setup", SETUPS.values(), ids=SETUPS)
def test_twelve_nodes_sense_the_target_and_seven_at_least(setup: Setup) -> None:
    """As many as there are cells in the circle of their range, on average: of 6000 steps within 0.15 of it."""
    targets = paths(setup, range(1, 101))[:, 1:, :2]
    apart = neighbours(setup, range(1, 101), targets) - targets[..., None, :]
    count = (np.linalg.norm(apart, axis=-1) <= setup.sense_m).sum(axis=-1)
    assert count.mean() == pytest.approx(np.pi * (setup.sense_m / setup.cell_m) ** 2, abs=0.15)
    assert count.min() >= 7


def test_a_cluster_is_of_the_nearest_nodes_of_all() -> None:
    target = np.array([[[-23.0, 41.0]]])
    far = np.stack(np.meshgrid(np.arange(-12, 8), np.arange(-6, 14)), axis=-1).reshape(-1, 2)
    every = 10.0 * (far + jitter(np.array(5), far))
    nearest = every[np.argsort(np.linalg.norm(every - target[0, 0], axis=-1))[:3]]
    assert cluster(WALK, [5], target)[0, 0] == pytest.approx(nearest)


def test_a_run_is_the_same_beside_others() -> None:
    one, many = world(OUTLIERS, [3]), world(OUTLIERS, [1, 2, 3, 4])
    assert np.array_equal(one.truth[0], many.truth[2])
    for a, b in zip(one.reports, many.reports, strict=True):
        assert np.array_equal(a.values[0], b.values[2])
        assert np.array_equal(a.positions[0], b.positions[2])


def test_readings_have_their_noise_and_outliers() -> None:
    seeds = range(1, 60)
    for setup in (WALK, ORIGIN, RSS["rss 4 dB"], OUTLIERS):
        told = world(setup, seeds)
        miss = np.stack(
            [
                some.values - setup.model.sensor.h(told.truth[:, t], some.positions)
                for t, some in enumerate(told.reports)
            ]
        )
        plain = miss[np.abs(miss) < 5.0 * setup.noise]
        if setup.outliers:
            clear = (miss > 4.0).mean()  # a reading is that far off by an outlier alone: of 0 to 20 m, 16 in 20 of them
            assert clear == pytest.approx(0.8 * setup.outliers, abs=0.01)
        else:
            assert plain.std() == pytest.approx(setup.noise, rel=0.03)
            assert len(plain) == miss.size
    assert told.reports[0].positions.shape == (59, 3, 2)
    assert not world(ORIGIN, [1]).reports[4].positions.any()


@pytest.mark.parametrize("case", SETUPS)
def test_the_bound_is_that_of_the_prototype(case: str) -> None:
    """An independent program's, over 500 runs, to 3 %."""
    setup = SETUPS[case]
    found = Found(60, {case: {"information": informations(setup, world(setup, range(1, 61)))}})
    assert bound(found, case, setup) == pytest.approx(BOUNDS[case], rel=0.03)


def test_distances_made_from_levels_are_too_long_on_average() -> None:
    setup = replace(RSS["rss 6 dB"], noise=6.0, steps=30)
    told, share = world(setup, range(1, 101)), 6.0 * np.log(10.0) / 30.0
    for unbiased, factor in ((False, np.exp(share**2 / 2.0)), (True, 1.0)):
        readings, model = converted(told, setup.model, unbiased=unbiased)
        true = [model.sensor.h(told.truth[:, t], some.positions) for t, some in enumerate(readings)]
        ratio = np.stack([some.values for some in readings]) / np.stack(true)
        assert ratio.mean() == pytest.approx(factor, rel=0.02)  # 9000 draws of sd 0.55


# --- filters ----------------------------------------------------------------------------------------------------------


def test_bootstraps_of_many_runs_are_the_tracker() -> None:
    """With resampling in every step: only then does the tracker draw as many numbers in each."""
    setup, seeds = replace(WALK, steps=12), [1, 2, 3]
    told = world(setup, seeds)
    together = bootstrap(80, ess=1.0)(setup.prior, told.reports, setup.model, generators(seeds, "b"))
    for run, seed in enumerate(seeds):
        tracker, rng = Bootstrap(80, ess_share=1.0), generator(seed, "b")
        state = tracker.init(setup.prior, setup.model)
        for t, some in enumerate(told.reports):
            state, estimate = tracker.step(state, alone(some, (run,)), 1.0, rng)
            assert together.mean[run, t] == pytest.approx(estimate.mean, rel=1e-9, abs=1e-9)


def test_the_squares_of_errors_in_units_of_their_covariance() -> None:
    covariance = np.array([[4.0, 0.0], [0.0, 9.0]])
    assert nees(np.array([2.0, 3.0]), covariance) == pytest.approx(2.0)
    assert nees(np.array([1.0, 1.0]), np.zeros((2, 2))) > 1e20


# --- what is said -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def found() -> Found:
    """Two runs of everything, and invented times."""
    figures = {name: one.run([1, 2]) for name, one in EXPERIMENTS.items()}
    return Found(2, figures, {name: [1e-6 * n, 2e-6 * n] for name, (_, n) in swept().items()})


def test_two_runs_say_little(found: Found, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    quick = {name: Experiment(lambda _, some=some: some, batch=2) for name, some in found.figures.items()}
    stored = replace(KERNELS, experiments=quick, times=lambda: found.times)
    monkeypatch.setattr("launcher.reproduce.kernels.command.kernels_named", lambda _: stored)
    study = reproduce_kernels("zhou", 2, tmp_path)
    assert {file.stem for file in (tmp_path / "figures").iterdir()} == {name for name, *_ in KERNELS.figures}
    summary = json.loads((tmp_path / "results.json").read_text())
    lost = [one["verdict"] for one in summary["claims"] if "loses no run" in one["name"] or "stably" in one["name"]]
    assert lost == [UNKNOWN, UNKNOWN]
    assert len(summary["claims"]) == len(JUDGES)
    assert len(summary["tables"]["errors"]) == len(SETUPS) * len(FILTERS)
    assert {row["tracker"] for row in summary["tables"]["particles"]} == set(swept())
    for heading in ("Claims", "Consistency", "Eq. 11 as printed", "Figures"):
        assert f"## {heading}" in study.report


def test_verdicts_follow_the_figures(found: Found) -> None:
    """The same two runs many times over, with errors that were scaled to either side of each rule."""

    def scaled(factors: dict[str, float]) -> dict[str, str]:
        figures = {
            case: {name: np.repeat(value, 60, axis=0) for name, value in some.items()}
            for case, some in found.figures.items()
        }
        for case in SETUPS:
            for name, factor in factors.items():
                unit = figures[case]["errors ukf"] / np.sqrt(
                    np.square(figures[case]["errors ukf"][..., :2]).sum(-1).mean()
                )
                figures[case][f"errors {name}"] = factor * BOUNDS[case] * unit
        return {claim.name: claim.verdict for claim in claims(Found(120, figures, found.times))}

    good = scaled({"gpf-ukf": 1.0, "upf": 1.1, "upf-paper": 1.2, "bootstrap-100": 30.0})
    bad = scaled({"gpf-ukf": 60.0, "upf": 30.0, "upf-paper": 60.0, "bootstrap-100": 20.0})
    sound, better = (
        "(Not in the paper) gpf-ukf comes near the bound",
        "(Not in the paper) A sound UPF is better than PF by",
    )
    assert good[sound] == "holds" and bad[sound] == "does not hold"
    assert [good[name] for name in good if name.startswith(better)] == ["holds"]
    assert [bad[name] for name in bad if name.startswith(better)] == ["does not hold"]
    assert good["UPF tracks stably"] == "holds" and bad["UPF tracks stably"] == "does not hold"
    assert min(TO_BOUND.values()) > 1.0


def test_the_particles_that_a_bootstrap_needs(found: Found) -> None:
    figures = {name: dict(some) for name, some in found.figures.items()}
    one = np.ones((2, 5, 2))
    for n in SWEEPS["bootstrap"][1]:
        figures["walk, particles"][f"errors bootstrap-{n}"] = one * 1000.0 / n
    figures["walk, particles"]["errors upf-100"] = one * 1.5
    figures["walk, particles"]["errors gpf-ukf-100"] = one * 0.01
    some = Found(2, figures)
    assert needed(some, "walk", "upf", 100) == 1000
    assert needed(some, "walk", "gpf-ukf", 100) is None
    assert [particles_over(n, 500) for n in (None, 200, 500)] == [True, False, True]


@pytest.mark.parametrize(("low", "high"), [(0.38, 1.35), (0.65, 2.6), (0.1, 3.0), (2.0, 50.0)])
def test_an_axis_says_where_it_begins_and_ends(low: float, high: float) -> None:
    axes = Figure().subplots()
    axes.plot([0.0, 1.0], [low, high])
    logarithmic(axes)
    told = [value for value in axes.yaxis.get_major_locator()() if low <= value <= high]
    assert 3 <= len(told) <= 9
    assert min(told) < 2.0 * low
    assert max(told) > high / 2.0
