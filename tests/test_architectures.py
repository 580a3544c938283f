"""Who is there and what for: what the launcher learns from an architecture, and what it tells whoever tracks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from launcher.plan.architectures import ARCHITECTURES, built
from launcher.plan.prepare import load
from launcher.records import BATTERY, SENSES, TRACKS, View
from tests.simulated import spcpf
from trackfield.filters.metrics import Lost
from trackfield.scenario import survey
from trackfield.scenario.architectures import ARCHITECTURES as SECTIONS
from trackfield.scenario.section import OTHER
from trackfield.tracking.bank import Bank
from trackfield.wire.messages import Doa
from trackfield.wire.registry import kind_of


def test_each_kind_that_a_scenario_may_name_is_built() -> None:
    assert ARCHITECTURES.own.keys() == SECTIONS.keys() - {OTHER}


def test_places_say_what_they_are_for() -> None:
    def centre_and_node(*settings: str) -> tuple[frozenset[str], frozenset[str]]:
        centre, node, *_ = built(survey(load("zhai-spcpf", settings=settings))).places
        return centre.tags, node.tags

    assert centre_and_node() == ({TRACKS}, {SENSES, BATTERY})
    assert centre_and_node("energy.centre_battery_j=5") == ({TRACKS, BATTERY}, {SENSES, BATTERY})


def test_places_need_no_tracker_that_is_there() -> None:
    """A report of a run with somebody's own tracker is made where that is not known."""
    scenario = load("zhai-spcpf")
    strange = scenario.model_copy(update={"fusion": scenario.fusion.model_copy(update={"trackers": ("nobodys",)})})
    assert len(built(survey(strange)).places) == 122


def test_views_and_flows_are_between_those_who_are_there() -> None:
    plan = spcpf(1, ["clock.offset_ms=5", "sensor.threshold=adaptive", "architecture.centre=hq"])
    assert plan.views == (View("base", ("hq",)),)
    assert [kind_of(flow.message).name for flow in plan.flows] == ["doa", "sync-request", "sync-reply", "threshold"]
    ids = {place.id for place in plan.info.places}
    for flow in plan.flows:
        assert len(flow.pairs) == 121
        assert {end for pair in flow.pairs for end in pair} == ids
        assert {pair[1] for pair in flow.pairs} == {"hq"} or {pair[0] for pair in flow.pairs} == {"hq"}


def test_all_but_the_first_who_track_draw_by_their_ids_too() -> None:
    plan = spcpf(1, ["fusion.trackers=['bootstrap']"])
    heard = {"n012": Doa(1, 40.0, 55.0), "n024": Doa(1, 220.0, 55.0)}

    def answer(source: str) -> tuple[float, ...]:
        bank = Bank(**plan.bank_of(source))
        return bank.advance(bank.begin(prior=True), 1, heard).points["bootstrap"].mean

    plan = replace(plan, banks={"fusion": {}, "n000": {"draws": ["n000"]}, "n001": {"draws": ["n001"]}})
    first, other, third = answer("fusion"), answer("n000"), answer("n001")
    assert (
        first
        == Bank(**plan.tracking).advance(Bank(**plan.tracking).begin(prior=True), 1, heard).points["bootstrap"].mean
    )
    assert len({first, other, third}) == 3
    assert np.hypot(*np.subtract(first, other)[:2]) < 10.0


def test_the_rule_of_loss_is_the_scenarios() -> None:
    assert spcpf().lost == Lost(50.0, 1, 1)
    assert spcpf(1, ["fusion.lost_m=9"]).lost == Lost(9.0, 1, 1)
    assert spcpf(1, ["score.lost={beyond_m=100, steps=10}"]).lost == Lost(100.0, 10, None)
