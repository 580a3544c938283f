"""The study of Özfidan et al. (2018): what its experiments leave, and what is said of their figures."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from launcher.reproduce.kernels.command import reproduce_kernels
from launcher.reproduce.kernels.study import Experiment, Figures, Found
from launcher.reproduce.papers.ozfidan import KERNELS, figures
from launcher.reproduce.papers.ozfidan.claims import JUDGES, claims
from launcher.reproduce.papers.ozfidan.energies import ALL, ledger, spent_mj, times_less
from launcher.reproduce.papers.ozfidan.energy import ACCOUNTS, CC2420, RADIO, REPORTS, frames
from launcher.reproduce.papers.ozfidan.experiments import (
    BOTH,
    DETECTION,
    EXPERIMENTS,
    FALLBACK,
    HOUSE,
    PAPER,
    PAPERS_POLICY,
    RARELY,
    SCALED,
    SCALED_STRICT,
    SWEEPS,
    SWEPT,
    each_rms,
)
from launcher.reproduce.papers.ozfidan.scheduling import POLICIES
from launcher.reproduce.papers.ozfidan.tables import bound, error, far, median_run, over_bound, tables
from launcher.reproduce.papers.ozfidan.words import BATCHED
from launcher.reproduce.tables import UNKNOWN

STEPS = 12


def short(experiment: Experiment) -> Figures:
    """Two runs of an experiment of a few steps."""
    run: Any = experiment.run
    setup, *others = run.args
    return partial(run.func, replace(setup, steps=STEPS), *others, **run.keywords)([1, 2])  # type: ignore[no-any-return]


@pytest.fixture(scope="module")
def found() -> Found:
    """Two short runs of everything."""
    return Found(2, {name: short(one) for name, one in EXPERIMENTS.items()})


# --- experiments ---


def test_every_field_of_the_sweeps_and_every_policy_is_run(found: Found) -> None:
    assert set(EXPERIMENTS) >= {*POLICIES, SCALED, SCALED_STRICT, HOUSE, RARELY, DETECTION}
    assert sum(len(sizes) for _, sizes in SWEEPS.values()) == len(SWEPT) == 14
    orphans = {name: found.figures[name]["ukf orphans"].tolist() for name in SWEPT}
    for name, setup in SWEPT.items():
        assert orphans[name] == [max(setup.slaves - setup.masters * setup.capacity, 0.0)] * 2
    assert found.figures[ALL]["ukf reports"].tolist() == [PAPER.slaves] * 2


def test_both_filters_have_the_same_target_and_field(found: Found) -> None:
    for name in POLICIES:
        some = found.figures[name]
        assert {key.removeprefix("ukf ") for key in some if key.startswith("ukf ")} == {
            key.removeprefix("pf ") for key in some if key.startswith("pf ")
        }
        assert np.array_equal(some["ukf all forwards"], some["pf all forwards"])
        assert some["ukf errors"].shape == some["pf errors"].shape == (2, STEPS, 2)
    assert found.figures[ALL]["same set"].tolist() == [1.0, 1.0]


def test_a_filter_that_expects_held_accelerations_errs_otherwise_though_hardly(found: Found) -> None:
    house, plain = (found.figures[name]["ukf errors"] for name in (HOUSE, FALLBACK))
    assert not np.array_equal(house, plain)
    assert house == pytest.approx(plain, abs=0.2)


def test_no_more_slaves_report_no_target_than_report(found: Found) -> None:
    some = found.figures[DETECTION]
    assert np.all(some["ukf silent"] <= some["ukf reports"])
    assert found.figures[FALLBACK]["ukf silent"].tolist() == [0.0, 0.0]


# --- what is said ---


def test_figures_by_hand() -> None:
    errors = np.zeros((2, 3, 2))
    errors[0, :, 0], errors[1, 2] = 5.0, (120.0, 160.0)
    some: dict[str, Any] = {"ukf errors": errors, "ukf bound": np.full((2, 3), 2.0)}
    told = Found(2, {"a": some})
    assert each_rms(errors) == pytest.approx([5.0, 200.0 / np.sqrt(3)])
    assert error(told, "a", "ukf").value == pytest.approx((5.0 + 200.0 / np.sqrt(3)) / 2)
    assert median_run(told, "a", "ukf").value == error(told, "a", "ukf").value
    assert bound(told, "a").value == pytest.approx(2.0)
    assert over_bound(told, "a", "ukf").value == pytest.approx(error(told, "a", "ukf").value / 2.0)
    assert far(told, "a", "ukf").value == 0.5


def test_no_scheduling_is_compared_in_the_same_runs(found: Found) -> None:
    theirs, ours = (ledger(found, FALLBACK, scheduled=scheduled) for scheduled in (False, True))
    assert theirs.counts["reports"].tolist() == [PAPER.slaves] * 2
    assert not theirs.scheduled and not ledger(found, ALL).scheduled
    ratio = spent_mj(theirs, CC2420, REPORTS).mean() / spent_mj(ours, CC2420, REPORTS).mean()
    assert times_less(found, FALLBACK, CC2420, REPORTS).value == pytest.approx(ratio)
    with_slaves = [len(np.unique(owner)) for owner in _owners()]
    assert frames(theirs).tolist() == [2 * (PAPER.slaves + masters) for masters in with_slaves]


def _owners() -> np.ndarray:
    return figures.drawn(replace(PAPER, steps=1), [1, 2]).owner


def test_two_runs_say_little(found: Found, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    quick = {name: Experiment(lambda _, some=some: some, batch=2) for name, some in found.figures.items()}
    stored = replace(KERNELS, experiments=quick)
    monkeypatch.setattr("launcher.reproduce.kernels.command.kernels_named", lambda _: stored)
    monkeypatch.setattr(figures, "PAPER", replace(PAPER, steps=STEPS))
    study = reproduce_kernels("ozfidan", 2, tmp_path, roles=True)
    assert {file.stem for file in (tmp_path / "figures").iterdir()} == {name for name, *_ in KERNELS.figures}
    summary = json.loads((tmp_path / "results.json").read_text())
    verdicts = {claim["name"]: claim["verdict"] for claim in summary["claims"]}
    assert len(verdicts) == len(JUDGES)
    assert verdicts["(Not in the paper) With the fallback the UKF keeps the target"] == UNKNOWN
    assert verdicts["(Not in the paper) Without it some runs lose the target for a while"] == UNKNOWN
    assert len(summary["tables"]["errors"]) == 2 * len(POLICIES) + 6 + len(SWEPT)
    radios, accounts = len(RADIO), 2 * len(ACCOUNTS)
    assert len(summary["tables"]["energy"]) == radios * accounts * (2 * (len(POLICIES) + 1) - 1)  # none for ``all``
    headings = [line for line in study.report.splitlines() if line.startswith("## ")]
    assert all(line.endswith(f"({BATCHED})") for line in headings[1:-1])


def many(found: Found, factors: Mapping[tuple[str, str], float]) -> Found:
    """The two runs many times over; the errors of some filters are the bound many times over."""
    figures = {
        case: {name: np.repeat(value, 60, axis=0) for name, value in some.items()}
        for case, some in found.figures.items()
    }
    for (case, kind), factor in factors.items():
        some = figures[case]
        some[f"{kind} errors"] = factor * np.stack([some[f"{kind} bound"] / np.sqrt(2.0)] * 2, axis=-1)
    return Found(120, figures)


def verdicts(some: Found) -> list[str]:
    """In the order of the claims."""
    return [claim.verdict for claim in claims(some)]


def test_verdicts_follow_the_errors(found: Found) -> None:
    """Scaled to either side of each rule: satisfactory, alike, near the bound, none far, held, rarely."""
    ours = [(FALLBACK, "ukf"), (FALLBACK, "pf"), (PAPERS_POLICY, "pf"), (HOUSE, "ukf"), (RARELY, "ukf")]
    order = [0, 3, 4, 5, 7, 8]
    good = verdicts(many(found, dict.fromkeys(ours, 1.0)))
    assert [good[i] for i in order] == ["holds"] * 6
    bad = dict(zip(ours, (1000.0, 1200.0, 1000.0, 2000.0, 2000.0), strict=True))
    assert [verdicts(many(found, bad))[i] for i in order] == ["does not hold"] * 6
    # 1.2 of the bound: more than the UKF may have, less than the PF may
    near = [{(FALLBACK, "ukf"): one, (FALLBACK, "pf"): other} for one, other in ((1.2, 1.0), (1.0, 1.2))]
    assert [verdicts(many(found, factors))[4] for factors in near] == ["does not hold", "holds"]


def test_one_excursion_is_too_many_with_the_fallback(found: Found) -> None:
    some = many(found, {})
    with_fallback = some.figures[FALLBACK]
    assert isinstance(with_fallback, dict)
    assert verdicts(some)[5] == "holds"
    with_fallback["ukf errors"][7, 2] = 90.0  # 127 m
    assert verdicts(some)[5] == "does not hold"


def test_verdicts_follow_excursions_and_what_is_the_same(found: Found) -> None:
    some = many(found, {})
    strict = some.figures[PAPERS_POLICY]
    assert isinstance(strict, dict)
    for share, expected in ((0.13, "holds"), (0.6, "does not hold"), (0.0, "does not hold")):
        for kind in BOTH:
            strict[f"{kind} errors"] = np.ones((120, STEPS, 2))
            strict[f"{kind} errors"][: round(share * 120), 3] = 90.0  # 127 m
        assert verdicts(some)[6] == expected
    one, often = np.linspace(0.995, 1.0, 120), np.linspace(0.93, 0.95, 120)
    for same, expected in ((one, "holds"), (often, "holds in part"), (often / 2, "does not hold")):
        strict["same set"] = same
        assert verdicts(some)[1] == expected


def test_the_verdict_on_power_follows_the_accounts(found: Found) -> None:
    some = many(found, {})
    strict = some.figures[PAPERS_POLICY]
    assert isinstance(strict, dict)
    assert verdicts(some)[2] == "holds in part"  # by reports alone
    for name in ("reports", "forwards", "asleep"):
        strict[f"ukf {name}"] = strict[f"ukf all {name}"]
    assert verdicts(some)[2] == "does not hold"


def test_what_lies_beside_the_prototype_is_in_its_band_or_not(found: Found) -> None:
    told = tables(many(found, {("nearest_4", "ukf"): 1.0, ("nearest_5", "ukf"): 9.0}))["prototype"]
    rows = {(row.case, row.quantity): row.verdict for row in told}
    assert rows["nearest_4", "awake"] == "in band"
    assert rows["nearest_5", "UKF, m"] == "outside"
