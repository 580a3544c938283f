"""The study of Yu et al. (2009) through roles and messages: figures, tables, claims; numbers of particles."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from launcher.plan.plan import make_plan
from launcher.record.ledger import Ledger
from launcher.record.metrics import run_metrics
from launcher.record.tables import TrackRow
from launcher.record.virtually import simulate
from launcher.records import Plan
from launcher.reproduce.kernels.scores import rmse
from launcher.reproduce.kernels.study import Figures, Found
from launcher.reproduce.papers.yu import dimension, judged, lifetimes, messages, roles
from launcher.reproduce.papers.yu.experiments import LAG
from launcher.reproduce.papers.yu.messages import errors_of, handovers, lost, saved
from launcher.reproduce.papers.yu.roles import AMOUNTS, BASE, COUNTS, KINDS, RUNS, R
from launcher.reproduce.papers.yu.truth import STEPS
from trackfield.scenario import Scenario

SHORT = 12


@cache
def ran() -> tuple[Plan, Ledger, list[TrackRow]]:
    changes = {**RUNS[BASE], "target.steps": SHORT}
    plan = make_plan(Scenario.load(roles.YU, {"seed": 1, **changes}), run="short")
    return plan, *simulate(plan)


def test_figures_are_those_of_the_runs_metrics() -> None:
    plan, ledger, rows = ran()
    figures, metrics = roles.figures_of(plan, ledger, rows), run_metrics(plan, ledger, rows)
    tracker = metrics["trackers"]["jm-rbpf"]
    assert np.sqrt(np.square(figures["errors"]).sum(axis=-1).mean()) == pytest.approx(tracker["rmse"]["position"])
    assert figures["handovers"] == metrics["leaders"]["handovers"]
    sent = dict(zip(KINDS, figures["frames"], strict=True))
    assert sent["poll"] == metrics["frames"]["by_kind"]["poll"]["sent"] == SHORT
    assert sent["energy"] == metrics["frames"]["by_kind"]["energy"]["sent"] > SHORT
    sizes = figures["payload"] / np.maximum(figures["frames"], 1.0)
    for kind, size in zip(KINDS, sizes, strict=True):
        assert size <= metrics["frames"]["by_kind"].get(kind, {"payload_bytes_max": 0})["payload_bytes_max"]


def test_the_setup_is_not_counted_and_time_on_air_is_that_of_the_bytes() -> None:
    """A result is a broadcast: 17 bytes around each frame, 32 us a byte; a poll has a long preamble before it."""
    plan, ledger, rows = ran()
    figures = roles.figures_of(plan, ledger, rows)
    assert "announce" in ledger.sent_kinds
    assert "announce" not in KINDS
    result, poll = KINDS.index("result"), KINDS.index("poll")
    assert figures["bytes on air"][result] == figures["payload"][result] + 17 * figures["frames"][result]
    assert figures["air, ms"][result] == pytest.approx(0.032 * figures["bytes on air"][result])
    assert figures["air, ms"][poll] > 10.0 * figures["air, ms"][result]


def test_smoothed_points_are_those_of_steps_with_a_lag_behind_them() -> None:
    """The first head looks back ``LAG`` steps; what comes after the last step less the lag is never told."""
    plan, ledger, rows = ran()
    there = np.isfinite(roles.figures_of(plan, ledger, rows)["smoothed"][:, 0])
    assert there.any()
    assert not there[SHORT - LAG :].any()


def figures(errors: float, runs: int = 3, handed: float = 8.0) -> Figures:
    """Of runs that are all alike: so many m to the east of the target, and 4 readings of 10 bytes in a step."""
    east = np.zeros((runs, STEPS, 2))
    east[..., 0] = errors
    truth = np.cumsum(np.ones((runs, STEPS, 2)), axis=1)
    amounts = np.zeros((runs, len(KINDS)))
    amounts[:, KINDS.index("energy")] = 4.0 * STEPS
    sums = {"frames": amounts, "payload": 10.0 * amounts, "bytes on air": 27.0 * amounts, "air, ms": amounts}
    assert tuple(sums) == AMOUNTS
    counts = dict.fromkeys(COUNTS, np.full(runs, handed))
    bound = np.full((runs, STEPS), 2.0)
    return {"errors": east, "smoothed": 0.5 * east, "truth": truth, "bound": bound, **sums, **counts}


def study(**errors: float) -> Found:
    """A study whose runs have these errors (m), by tracker; 4 m of any other."""
    found: dict[str, Any] = {name: figures(errors.get(messages.short(name).split(",")[0], 4.0)) for name in RUNS}
    found[roles.NEAREST] = figures(4.0, handed=15.0)
    watts = {"watts": np.full((3, 5), 0.01), "frames": np.full(3, 5.0)}
    found |= dict.fromkeys(lifetimes.EXPERIMENTS, watts)
    return Found(3, found)


def test_verdicts_follow_the_figures() -> None:
    good = {one.name: one.verdict for one in judged.claims(study(rbpf=60.0, mrbpf=10.0))}
    bad = {one.name: one.verdict for one in judged.claims(study(rbpf=10.0, mrbpf=10.0, **{"jm-rbpf": 6.0}))}
    table_2, jump = (next(name for name in good if what in name) for what in ("Table 2", "mode in each"))
    assert (good[table_2], bad[table_2]) == ("holds", "does not hold")
    assert (good[jump], bad[jump]) == ("too few runs to tell", "does not hold")
    assert judged.claims(Found(3, {})) == []


def test_a_run_without_a_track_is_lost_and_its_steps_are_no_errors() -> None:
    found = study()
    errors = found.figures[BASE]["errors"]
    errors[0, 20:30] = np.nan
    assert lost(found, BASE).value == pytest.approx(1 / 3)
    assert messages.followed(errors) == pytest.approx(1.0 - 10 / (3 * STEPS))
    assert rmse(errors_of(found, BASE)).value == pytest.approx(4.0)


def test_counts_in_a_step_and_bytes_beside_the_sound_itself() -> None:
    found = study()
    assert handovers(found, BASE).value == pytest.approx(0.08)
    assert saved(found).value == pytest.approx(4 * 8000.0 / 40.0)


def test_every_run_is_in_a_table(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(messages, "CASES", {})  # no bare filters beside them
    text = "\n".join(part for _, part in messages.parts(study()))
    for name in RUNS:
        assert f"| {messages.short(name)} " in text or ", hands over: " in name
    assert all(f"| {field} " in text for field in lifetimes.FIELDS)
    assert messages.parts(Found(3, {})) == []
    assert messages.tables(Found(3, {})) == {}
    assert all(name.startswith(R) for name in (*RUNS, *lifetimes.EXPERIMENTS))


# --- numbers of particles ---


def test_so_many_particles_the_generic_filter_takes() -> None:
    errors = {100: (3.0, 9.0), 200: (2.0, 5.0), 500: (1.5, 3.0), 1000: (1.2, 2.0), 2000: (1.0, 1.1)}
    found: dict[str, Any] = {}
    for n, pair in errors.items():
        for filter, error in zip((dimension.REDUCED, dimension.GENERIC), pair, strict=True):
            found[dimension.name_of(filter, n)] = {"errors": np.full((2, 4, 2), error)}
    said = dimension.equal(Found(2, found))
    assert dimension.claim(Found(2, found)).verdict == "holds"
    assert "100: 500; 200: 1000; 500: 2000; 1000: 2000; 2000: more than 2000" in said


def test_with_many_particles_it_makes_no_difference_what_is_in_them() -> None:
    """With 1000 particles in 10 runs; the ratio of errors has an sd of 2 %, so 10 % are 5 of them."""
    experiments = [
        dimension.EXPERIMENTS[dimension.name_of(some, 1000)] for some in (dimension.REDUCED, dimension.GENERIC)
    ]
    reduced, generic = (
        float(np.sqrt(np.square(one.run(range(1, 11))["errors"]).sum(axis=-1).mean())) for one in experiments
    )
    assert generic / reduced == pytest.approx(1.0, abs=0.1)
    assert generic != reduced
