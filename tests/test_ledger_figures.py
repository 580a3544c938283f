"""The energy ledger of metrics.json and what the base knew: by hand, and that all parts add up in whole runs."""

from __future__ import annotations

from dataclasses import replace

import pytest

from launcher.record.figures.at_base import base_age, base_rows
from launcher.record.figures.energy import batteries_of, devices_of
from launcher.record.figures.overhearing import overheard_ns
from launcher.record.figures.periods import PERIODS, Span, spans_of
from launcher.record.figures.scores import detection_s, first_in_range
from launcher.record.figures.spending import SHARE_PRESENT, divided, ledger_metrics, period_of
from launcher.record.ledger import Ledger
from launcher.record.metrics import Metrics, run_metrics
from launcher.records import SENSES, Place, Plan
from tests.simulated import simulated, spcpf
from tests.test_energy import CENTRE, N0, N1, TEN, TWENTY, final, frame, plan_of, switch
from tests.tiny import point, tiny
from trackfield.role import NS
from trackfield.world.path import Path


def lasting(end_s: float, *stays: tuple[float, float], origin_s: float = 0.0) -> Plan:
    """A run of so long, and targets that are there from one time to another."""
    plan = tiny()
    paths = {
        f"t{number}": Path.of([(a, a, 0.0, 1.0, 0.0), (b, b, 0.0, 1.0, 0.0)]) for number, (a, b) in enumerate(stays)
    }
    run, info = replace(plan.run, end_ns=round(end_s * NS)), replace(plan.info, origin_ns=round(origin_s * NS))
    return replace(plan, paths=paths, run=run, info=info)


def spans(plan: Plan) -> list[tuple[str, float, float]]:
    return [(one.period, one.begin_ns / NS, one.end_ns / NS) for one in spans_of(plan, plan.run.end_ns)]


# --- periods ----------------------------------------------------------------------------------------------------------


def test_a_run_with_a_target_to_its_end_is_never_idle() -> None:
    assert spans(lasting(5, (0, 4))) == [("present", 0, 5)]
    assert spans(lasting(15, (10, 14), origin_s=10)) == [("setup", 0, 10), ("present", 10, 15)]


def test_the_second_half_of_the_time_without_a_target_is_idle() -> None:
    found = spans(lasting(65, (10, 24), origin_s=10))
    assert found == [("setup", 0, 10), ("present", 10, 25), ("settling", 25, 45), ("idle", 45, 65)]


def test_only_the_longest_of_several_stretches_is_idle_and_none_that_is_short() -> None:
    found = spans(lasting(60, (5, 9), (7, 11), (32, 50)))
    expected = [("settling", 0, 5), ("present", 5, 12), ("settling", 12, 22), ("idle", 22, 32)]
    assert found == [*expected, ("present", 32, 51), ("settling", 51, 60)]
    assert "idle" not in dict.fromkeys(name for name, *_ in spans(lasting(14, (0, 4))))  # 9 steps


def test_a_run_that_was_cut_off_has_no_more_periods() -> None:
    plan = lasting(65, (10, 24), origin_s=10)
    assert [one.period for one in spans_of(plan, 20 * NS)] == ["setup", "present"]
    assert spans_of(plan, 0) == ()


def test_where_nobody_knows_of_a_target_one_is_always_there() -> None:
    assert spans(replace(lasting(65, origin_s=5), paths={})) == [("setup", 0, 5), ("present", 5, 65)]


def test_an_instant_is_in_the_period_that_begins_with_it() -> None:
    period = period_of([Span("setup", 0, 10), Span("present", 10, 20)])
    assert [period(at) for at in (0, 9, 10, 19, 20)] == ["setup", "setup", "present", "present", "present"]


# --- the ledger, by hand ----------------------------------------------------------------------------------------------


def by_hand() -> tuple[Plan, Ledger]:
    """Two nodes for 40 s; a target for 10. N0 listens for 2 s with it and for 1 s when the field is idle."""
    plan = replace(plan_of(CENTRE, N0, N1, end_s=40), paths={"t": lasting(40, (0, 9)).paths["t0"]})
    book = Ledger(plan.run, plan.processes)
    for t_ms, on in ((0, False), (2000, True), (4000, False), (30_000, True), (31_000, False)):
        switch(book, "n0", t_ms, on)
    switch(book, "n1", 0, False)
    book.sent(frame(1000, "n0", "fusion", TEN))  # 27 bytes, with a target
    book.sent(frame(35_000, "n0", "fusion", TWENTY))  # 37, in the idle field
    final(book, "n0", 64, 0, 3000, 36_936, 5, metered_s=40)
    final(book, "n1", 0, 0, 0, 40_000, 0, metered_s=40)
    book.close()
    return plan, book


def ledger_of(plan: Plan, book: Ledger) -> Metrics:
    batteries = batteries_of(plan, book)
    period = period_of(spans_of(plan, plan.run.end_ns))
    return ledger_metrics(plan, book, batteries, overheard_ns(book, devices_of(batteries), period))


def test_what_was_spent_stands_in_the_period_in_which_it_was() -> None:
    """70 mW for 64 ms of sending, divided as 27 to 37; 40 mW for listening; 1 mW for sleep."""
    found = ledger_of(*by_hand())
    assert [found[period]["s"] for period in PERIODS] == [0, 10, 15, 15]
    assert [found[period]["bytes"] for period in PERIODS] == [0, 10, 0, 20]
    sent = [found[period]["by"]["reports"] + found[period]["by"]["control"] for period in PERIODS]
    assert sent == pytest.approx([0, 70e-3 * 0.027, 0, 70e-3 * 0.037])
    assert [found[period]["by"]["listen"] for period in PERIODS] == pytest.approx([0, 80e-3, 0, 40e-3])
    slept = [0, 1e-3 * (7.973 + 10), 1e-3 * 30, 1e-3 * (13.963 + 15)]
    assert [found[period]["by"]["sleep"] for period in PERIODS] == pytest.approx(slept)
    assert sum(found[period]["by"]["sense"] for period in PERIODS) == pytest.approx(5e-6)


def test_power_and_life_follow_from_both_periods() -> None:
    """A joule in each battery; N1 sleeps at 1 mW all the time, N0 is the hotter one."""
    found = ledger_of(*by_hand())
    present, idle = (found[period]["total_j"] for period in ("present", "idle"))
    assert found["power_w"] == pytest.approx({"present": present / 10, "idle": idle / 15})
    hot = present - 0.010
    assert found["hottest"] == pytest.approx(2 * hot / present)
    power = SHARE_PRESENT * hot / 10 + (1 - SHARE_PRESENT) * (idle - 0.015) / 15
    life = {"first_death": 1 / power, "half_dead": 1 / power}  # the first of two is half of them
    assert found["lifetime_s"] == pytest.approx(life)


def test_without_an_idle_period_there_is_no_life_of_the_field() -> None:
    plan, book = by_hand()
    plan = replace(plan, paths={"t": lasting(40, (0, 39)).paths["t0"]})
    found = ledger_of(plan, book)
    assert found["power_w"]["idle"] is None
    assert found["lifetime_s"] == {"first_death": None, "half_dead": None}
    assert found["power_w"]["present"] > 0


def test_a_total_is_divided_by_the_first_shares_that_there_are() -> None:
    assert divided(6, {"a": 1, "b": 2}, {"c": 1}) == {"a": 2, "b": 4}
    assert divided(6, {}, {"a": 0}, {"c": 3}) == {"c": 6}
    assert divided(6, {}) == divided(0, {"a": 1}) == {}


# --- whole runs -------------------------------------------------------------------------------------------------------

RADIO = ("target.steps=8", "run.idle_s=30", "clock.offset_ms=20", "energy.battery_j=2000", "run.setup_s=3")


@pytest.mark.parametrize("more", [(), ("sensor.threshold=adaptive",), ("faults=[{kind='kill', share=0.2, at_s=4}]",)])
def test_the_parts_of_the_ledger_add_up_to_what_was_metered(more: tuple[str, ...]) -> None:
    plan = spcpf(1, [*RADIO, *more])
    metrics = run_metrics(plan, *simulated(plan))
    ledger, energy = metrics["ledger"], metrics["energy_j"]
    assert [ledger[period]["s"] for period in PERIODS] == [3, 9, 15, 15]
    assert sum(ledger[period]["total_j"] for period in PERIODS) == pytest.approx(energy["total"])
    by = {name: sum(ledger[period]["by"][name] for period in PERIODS) for name in ledger["idle"]["by"]}
    assert by["overhear"] + by["listen"] == pytest.approx(energy["by"]["listen"])
    assert by["sync"] + by["reports"] + by["control"] == pytest.approx(energy["by"]["send"] + energy["by"]["receive"])
    assert by["sleep"] == pytest.approx(energy["by"]["sleep"])
    assert sum(ledger[period]["bytes"] for period in PERIODS) == metrics["bytes"]["on_air"]
    assert ledger["idle"]["by"]["reports"] == 0 < ledger["present"]["by"]["reports"]


def test_tracks_do_not_depend_on_the_time_after_them() -> None:
    with_idle, without = (spcpf(1, ["target.steps=6", f"run.idle_s={s}"]) for s in (20, 0))
    assert with_idle.run.end_ns == without.run.end_ns + 20 * NS
    scores = [run_metrics(plan, *simulated(plan))["trackers"] for plan in (with_idle, without)]
    for one, other in zip(*(each.values() for each in scores), strict=True):
        assert {**one, "sources": 0, "views": 0} == {**other, "sources": 0, "views": 0}


# --- at the base ------------------------------------------------------------------------------------------------------


def test_the_age_grows_from_one_publication_to_the_next() -> None:
    """Told .3 s after each of steps 1 to 4, to 5 s: ages of .3 to 1.3 s three times, and of .3 to 1 s."""
    plan = tiny()
    rows = base_rows(plan, [point(step, (1, 0, 0, 0)) for step in (1, 2, 3, 4)])
    found = base_age(plan, rows, 5 * NS)
    assert found["base_mean"] == pytest.approx((3 * 0.8 + 0.7 * 0.65) / 3.7)
    assert found["base_p95"] == pytest.approx(1.3 - 0.05 * 3.7 / 3, abs=0.01)


def test_what_a_point_was_predicted_from_is_what_counts() -> None:
    plan = tiny()
    told = [point(step, (1, 0, 0, 0)) for step in (1, 2, 3, 4)]
    told = [replace(row, point=replace(row.point, known_step=1)) for row in told]
    assert base_age(plan, base_rows(plan, told), 5 * NS)["base_mean"] == pytest.approx((0.3 + 4.0) / 2)
    nothing = {"base_mean": None, "base_p95": None}
    assert base_age(plan, base_rows(plan, [point(1, None)]), 5 * NS) == nothing


def test_detection_counts_from_when_a_target_is_in_range_to_a_track_that_is_near() -> None:
    """The target goes east at 1 m/s; the only sensor reaches 10 m and stands 12.5 m ahead of its start."""
    plan = lasting(12, (0, 11))
    near = Place("n0", "node", 12.5, 0.0, frozenset({SENSES}))
    plan = replace(plan, info=replace(plan.info, places=(near,)), reaches={"n0": 10.0})
    assert first_in_range(plan) == 3
    rows = [point(2, (0, 0, 0, 0)), point(4, (99, 0, 0, 0)), point(5, None), point(6, (3, 0, 0, 0))]
    assert detection_s(plan, rows, 3) == pytest.approx(3.3)
    assert detection_s(plan, rows[:3], 3) is None
    assert first_in_range(replace(plan, reaches={"n0": 1.0})) is None
    assert first_in_range(lasting(5, (0, 4))) == 1
