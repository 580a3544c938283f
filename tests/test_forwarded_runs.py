"""Runs in which a process publishes tracks that it has by radio: what it shows, its bound, its replay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from math import isfinite
from pathlib import Path

import pytest

from launcher.record.figures.bounds import run_bounds
from launcher.record.ledger import Ledger, Published
from launcher.record.metrics import run_metrics
from launcher.record.tables import TrackRow, track_rows, write_tracks
from launcher.records import Plan
from launcher.study.replay import read_points, repeated
from tests.simulated import simulated
from tests.two_centres import BASE, CENTRES, two_centres
from trackfield.role import NS, Publish, TrackPoint
from trackfield.tracking.forwarding import Numbering, received
from trackfield.wire import decode

Run = tuple[Plan, Ledger, list[TrackRow]]
LATE = ("link.model=gilbert_elliott", "link.delay_ms=100", "link.jitter_ms=400", "fusion.max_age_s=2.5")

LOSSY = ("link.model=fixed", "link.loss=0.3")
DEAD = "faults=[{kind='restart', nodes=['fusion'], at_s=12.4, until_s=17.7}]"
MISSED = (*LATE, "link.loss_good=0.2")


@cache
def run(settings: Sequence[str] = (), kill_s: float | None = None) -> Run:
    second = {} if kill_s is None else {"kill_ns": round(kill_s * NS)}
    plan = two_centres(settings=["target.steps=30", *settings], **second)
    return plan, *simulated(plan)


def of(rows: Sequence[TrackRow], *sources: str) -> dict[tuple[str, str, int], TrackRow]:
    return {(row.point.source, row.point.tracker, row.t_ns): row for row in rows if row.point.source in sources}


def as_received(plan: Plan, point: TrackPoint) -> TrackPoint | None:
    return received(point, Numbering(plan.tracking["trackers"], [id for id, *_ in plan.tracking["sensors"]], NS))


# --- what it shows ----------------------------------------------------------------------------------------------------


def test_each_point_is_that_of_its_origin_at_its_instant() -> None:
    plan, ledger, rows = run()
    made, shown = of(rows, *CENTRES), of(rows, BASE)
    assert {row.point.origin for row in shown.values()} == set(CENTRES)
    assert len(shown) > 40
    for (_, tracker, t_ns), row in shown.items():
        of_origin = made[row.point.origin, tracker, t_ns]
        assert row.point == replace(as_received(plan, of_origin.point), source=BASE)
        assert row.told_ns > of_origin.told_ns
    assert not [row for row in made.values() if row.point.origin]
    assert ledger.payload_max["track"] <= 90


def test_it_knows_what_messages_say_and_nothing_else() -> None:
    """Cut off from 10 s to 20 s it shows nothing of that time."""
    cut = "faults=[{kind='partition', nodes=['fusion'], at_s=10, until_s=20}]"
    plan, *_ = run((cut,))
    cuts = [(from_ns, until_ns, (BASE,), None) for from_ns, until_ns, *_ in plan.run.partitions]
    plan = replace(plan, run=replace(plan.run, partitions=tuple(cuts)))
    _, rows = simulated(plan)
    instants = {row.t_ns // NS for row in rows if row.point.source == BASE}
    assert instants & set(range(1, 30)) == {*range(1, 10), *range(20, 30)}


def test_it_goes_on_with_the_other_one_when_a_centre_dies() -> None:
    plan, _, rows = run(kill_s=12.0)
    shown = of(rows, BASE).values()
    assert {row.point.origin for row in shown if row.t_ns < 12 * NS} == set(CENTRES)
    assert {row.point.origin for row in shown if row.t_ns >= 12 * NS} == {"fusion"}
    bound = run_bounds(plan, rows)
    assert all(bound[BASE][row.t_ns] == bound["fusion"][row.t_ns] for row in shown if row.t_ns >= 12 * NS)


def test_a_centre_that_returns_hands_on_what_it_resumes_with() -> None:
    """A point of each of its two trackers, of the last step before its return; its radio sends them one by one."""
    _, ledger, rows = run((DEAD,))
    tracks = [row for row in ledger.rows if row.kind == "track" and row.src == "fusion"]
    sent = [row for row in tracks if 17.7 * NS <= row.sent_ns < 17.8 * NS]
    assert [decode(row.payload).at_us for row in sent] == [17_000_000, 17_000_000]
    assert [row.text for row in sent] == [
        f"the track at 17.000 s (tracker {number}, 0 reports, 0.700 s old)" for number in (0, 1)
    ]
    away = {row.point.origin for row in of(rows, BASE).values() if 13 <= row.t_ns / NS <= 16}
    assert away == {"second"}


def test_a_step_that_was_fused_again_comes_again() -> None:
    """The base knows each step first without the late reports, and nearly all of them with these in the end."""
    _, _, rows = run(LATE)
    made, shown = of(rows, *CENTRES), of(rows, BASE)
    last = [
        row
        for (_, *of_what), row in shown.items()
        if row.point.sensors == made[row.point.origin, *of_what].point.sensors
    ]
    assert len(last) > 0.9 * len(shown)
    assert sum(row.told_ns - row.t_ns < NS for row in last) > 0.8 * len(shown)


# --- figures ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kill_s", [None, 12.0])
def test_its_bound_is_that_of_its_origins_and_its_figures_are_in_its_view(kill_s: float | None) -> None:
    plan, ledger, rows = run(kill_s=kill_s)
    bounds = run_bounds(plan, rows)
    for (_, tracker, t_ns), row in of(rows, BASE).items():
        others = [one.point.origin for one in of(rows, BASE).values() if one.t_ns == t_ns]
        assert bounds[BASE][t_ns] == min(bounds[origin][t_ns] for origin in others)
        assert row.point.origin in others and tracker
    metrics = run_metrics(plan, ledger, rows)
    assert isfinite(metrics["bound"]["trajectory"])
    for figures in metrics["trackers"].values():
        assert figures["times_bound"] > 0.8
        assert figures["views"].keys() == {"base", "in-network"}
        assert figures["views"]["base"]["rmse"] == figures["rmse"]
        assert figures["sources"].keys() == {*CENTRES, BASE}


# --- again ------------------------------------------------------------------------------------------------------------


def replayed(run: Run, folder: Path, trackers: Sequence[str] = ()) -> list[TrackRow]:
    """The tracks of a replay with other trackers, from the tables of the run."""
    plan, ledger, rows = run
    write_tracks(rows, {}, folder / "tracks.parquet")
    if trackers:
        plan = replace(plan, tracking={**plan.tracking, "trackers": list(trackers)})
    told = repeated(plan, read_points(folder), ledger.rows, plan.info.trackers)
    published = [
        Published(t_ns, one.source, one.incarnation, effect.estimate)
        for one, t_ns, effect in told
        if isinstance(effect, Publish)
    ]
    return track_rows(published, plan.paths)


@pytest.mark.parametrize("kill_s", [None, 12.0])
@pytest.mark.parametrize("settings", [(), LOSSY, LATE, (DEAD,), ("fusion.prior=none", "fusion.smooth_lag=2")])
def test_a_replay_shows_the_same_bit_for_bit(settings: Sequence[str], kill_s: float | None, tmp_path: Path) -> None:
    was = run(settings, kill_s)
    assert replayed(was, tmp_path) == was[2]


def test_where_reports_were_late_a_replay_has_the_last_estimate_of_the_origin(tmp_path: Path) -> None:
    """The run's base missed some of them."""
    was = run(MISSED)
    before, after = (of(rows, *CENTRES, BASE) for rows in (was[2], replayed(was, tmp_path)))
    assert before.keys() == after.keys()
    changed = [key for key in before if before[key] != after[key]]
    assert 0 < len(changed) < 0.1 * len(before)
    for key in changed:
        source, *what = key
        origin = before[key].point.origin
        assert (source, origin) == (BASE, after[key].point.origin)
        assert before[key].point != replace(as_received(was[0], before[origin, *what].point), source=BASE)


def test_other_trackers_go_by_the_origin_that_was_chosen_in_the_run(tmp_path: Path) -> None:
    """A tracker of the run by its own, another one by the first of the run that the base published then."""
    was = run(LOSSY)
    found = replayed(was, tmp_path, ["ekf", "spcpf"])
    chosen: dict[tuple[str, int], str] = {}
    for (_, tracker, t_ns), row in of(was[2], BASE).items():  # imm-ukf comes before spcpf
        chosen.setdefault(("ekf", t_ns), row.point.origin)
        chosen[tracker, t_ns] = row.point.origin
    made, shown = of(found, *CENTRES), of(found, BASE)
    expected = {key: origin for key, origin in chosen.items() if key[0] != "imm-ukf"}
    assert {(tracker, t_ns): row.point.origin for (_, tracker, t_ns), row in shown.items()} == expected
    for (_, *what), row in shown.items():
        assert row.point.mean == pytest.approx(made[row.point.origin, *what].point.mean, rel=1e-6)


def test_an_origin_that_left_no_track_is_no_error(tmp_path: Path) -> None:
    plan, ledger, rows = run()
    alone = [row for row in rows if row.point.source == BASE]
    assert replayed((plan, ledger, alone), tmp_path) == []
