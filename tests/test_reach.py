"""Who hears whom: cells and peers by the reach of radios, alike for both drivers and the ledger."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from math import dist, hypot
from typing import Any

import pytest

import trackfield as tf
from launcher.plan.architectures import ARCHITECTURES
from launcher.plan.prepare import planned
from launcher.plan.reach import MOST_PAIRS, cells_of, neighbours
from launcher.records import Plan
from tests.criers import Crying
from tests.protocols.agreement import in_time
from tests.simulated import simulated
from trackfield.drivers.engine.meter import done
from trackfield.drivers.spec import ProcessSpec
from trackfield.errors import ScenarioError
from trackfield.link.lognormal_prr import LEAST_SHARE, LognormalPrr
from trackfield.link.models import make_link, reach_m

RADIO = {"model": "lognormal_prr", "radio": "802154-0dbm"}
SMALL = {"field.nodes": 9, "target.steps": 6, "link": {**RADIO, "radio": "802154-0dbm"}, "architecture.kind": "own"}


@pytest.fixture(autouse=True)
def registry() -> Any:
    yield
    ARCHITECTURES.registered.clear()


def crying(architecture: type = Crying, **settings: Any) -> Plan:
    tf.register_architecture("own", architecture)
    return planned(tf.Scenario.load("zhai-spcpf", {**SMALL, **settings}))


def at(places: list[tuple[float, float]]) -> list[ProcessSpec]:
    return [ProcessSpec(f"p{i}", "toy", "none", x=x, y=y) for i, (x, y) in enumerate(places)]


def row(n: int, spacing_m: float) -> list[ProcessSpec]:
    return at([(i * spacing_m, 0.0) for i in range(n)])


def link_among(processes: list[ProcessSpec], **spec: Any) -> Any:
    return make_link({**RADIO, **spec}, 1, {p.id: p.place for p in processes})


# --- how far a link reaches -------------------------------------------------------------------------------------------


def test_beyond_its_reach_next_to_no_link_carries_anything() -> None:
    """Of pairs just beyond, one in a thousand does; of pairs at a quarter of it two thirds do."""
    processes = at([(0.0, 0.0)])
    reach = link_among(processes).reach_m
    ring = [(reach * 1.001, float(i)) for i in range(-1000, 1000)]
    nearer = [(reach / 4, i / 10) for i in range(-100, 100)]
    for places, most, least in ((ring, 10, 0), (nearer, 170, 100)):
        others = at([(0.0, 0.0), *places])
        link = link_among(others)
        heard = sum(link.prr("p0", p.id, 17) >= LEAST_SHARE for p in others[1:])
        assert least <= heard <= most


@pytest.mark.parametrize("power_dbm", [-20.0, 0.0])
def test_the_reach_is_where_a_link_three_sds_better_than_the_mean_ends(power_dbm: float) -> None:
    link = LognormalPrr(1, {}, radio="802154-0dbm", tx_dbm=power_dbm)
    spare_db = 3 * hypot(4.0, 1.0)
    for share, heard in ((0.99, True), (1.01, False)):
        snr_db = power_dbm - link.channel.mean_db(share * link.reach_m) + spare_db - link.noise_dbm
        assert (link.radio.prr(snr_db, 17) >= LEAST_SHARE) == heard


def test_the_loudest_of_all_says_how_far_it_is() -> None:
    quiet, loud = LognormalPrr(1, {}, tx_dbm=0.0), LognormalPrr(1, {}, tx_dbm=0.0, tx_dbms={"a": 10.0})
    assert loud.reach_m == LognormalPrr(1, {}, tx_dbm=10.0).reach_m > 2 * quiet.reach_m


def test_a_range_ends_it_sooner_and_a_wire_never_does() -> None:
    assert reach_m(make_link({**RADIO, "range_m": 50.0, "burst_loss": 0.1}, 1)) == 50.0
    assert reach_m(make_link({"model": "ethernet"}, 1)) == reach_m(make_link({"model": "ideal"}, 1)) == float("inf")


# --- neighbours and cells ---------------------------------------------------------------------------------------------


def test_neighbours_are_those_of_whom_one_hears_the_other() -> None:
    processes = row(60, 10.0)
    link = link_among(processes)
    near = neighbours(processes, link, "field")
    for a in processes:
        for b in processes:
            if a.id != b.id:
                heard = max(link.reception(a.id, b.id, 0), link.reception(b.id, a.id, 0)) >= LEAST_SHARE
                assert (b.id in near[a.id]) == (a.id in near[b.id]) == heard
    assert 0 < min(map(len, near.values())) < max(map(len, near.values())) < 59


def test_one_that_walks_is_a_neighbour_of_all_that_it_comes_by() -> None:
    walker = ProcessSpec("w", "toy", "none", legs=((0, 0.0, 30.0), (10**9, 1000.0, 30.0), (2 * 10**9, 1000.0, 900.0)))
    still = row(200, 10.0)
    near = neighbours([walker, *still], link_among([walker, *still], range_m=50.0), "field")
    for p in still:
        nearest = min(dist((p.x, p.y), (min(max(p.x, 0.0), 1000.0), 30.0)), dist((p.x, p.y), (1000.0, 30.0)))
        if nearest <= 50.0:
            assert "w" in near[p.id]
        if nearest > 80.0:
            assert "w" not in near[p.id]


def test_too_many_pairs_are_refused() -> None:
    with pytest.raises(ScenarioError, match=f"pairs of processes would hear each other.*at most {MOST_PAIRS}"):
        neighbours(row(4000, 0.1), make_link({"model": "ideal"}, 1), "field")


def test_those_in_reach_are_in_the_same_cell_or_the_next() -> None:
    processes = at([(x * 37.0 - 500, y * 41.0 - 300) for x in range(30) for y in range(20)])
    link = link_among(processes, range_m=100.0)
    cells = cells_of(processes, link)
    column, line = ({id: int(part[1:]) for id, part in parts} for parts in zip(
        *(((id, cell.split("_")[0]), (id, cell.split("_")[1])) for id, cell in cells.items()), strict=True
    ))  # fmt: skip
    for id, others in neighbours(processes, link, "field").items():
        assert all(abs(column[id] - column[o]) <= 1 and abs(line[id] - line[o]) <= 1 for o in others)
    assert len(set(cells.values())) > 60


# --- in a plan --------------------------------------------------------------------------------------------------------


def test_a_process_knows_those_in_reach_and_not_the_field() -> None:
    plan = crying()
    spec = {p.id: p for p in plan.processes}
    assert "c7" not in spec["c1"].peers
    assert {"c0", "c2"} <= spec["c1"].peers.keys()
    assert spec["c1"].cell in spec["c2"].cells
    assert not spec["fusion"].cells
    assert spec["c0"].cell == "c0"  # it walks: a cell of its own
    assert spec["c8"].peers.keys() == {"c9", "c10"}  # by wire, from anywhere
    assert spec["c8"].cells == ()
    near = [flow for flow in plan.flows if flow.near]
    assert {flow.medium for flow in near} == {"field", "backbone"}
    assert ("c8", "c10") in next(flow.pairs for flow in near if flow.medium == "backbone")


def test_what_is_expected_are_hearers_in_reach() -> None:
    plan = crying()
    rows = [r for r in simulated(plan)[0].rows if r.kind == "feedback"]
    spec = {p.id: p for p in plan.processes}
    assert Counter((r.src, r.sent_ns) for r in rows if r.src == "c1").most_common(1)[0][1] == len(spec["c1"].peers)
    assert all(r.src in spec[r.dst].peers for r in rows)
    assert {(r.src, r.dst) for r in rows if r.medium == "backbone"} == {
        (a, b) for a in ("c8", "c9", "c10") for b in ("c8", "c9", "c10") if a != b
    }
    assert sum(r.delivered for r in rows) > 50


def test_both_drivers_agree_on_who_hears_whom() -> None:
    one = in_time(crying(), 5.0, 1.0)
    assert one.found == ()
    assert one.host_late == 0
    assert one.metrics["frames"]["by_kind"]["feedback"]["sent"] > 50


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"media": ["feld"]}, "c10.media: there is no medium 'feld'; did you mean field?"),
        ({"over": {"feedbak": "backbone"}}, "c10.over: is {'feedbak': 'backbone'}; expected a medium by the kind"),
        ({"over": {}}, "c10.over: feedback goes over 'field', which c10 does not have; expected a medium that both"),
        ({"hears": "feedback"}, "c10.hears: is 'feedback'; expected a list of kinds of messages"),
    ],
)
def test_what_is_wrong_with_media_is_said(change: dict[str, Any], message: str) -> None:
    class Wrong(Crying):
        def arrange(self, field: tf.Field) -> tf.Arranged:
            arranged = super().arrange(field)
            *others, last = arranged.processes
            return replace(arranged, processes=[*others, replace(last, **change)])

    with pytest.raises(ScenarioError) as caught:
        crying(Wrong)
    assert message in str(caught.value)


def test_a_process_pays_for_the_radios_of_all_its_media() -> None:
    """One hears the field, too; the others have a processor and a Wi-Fi radio: 6 mW and its own, from one battery."""

    class Powered(Crying):
        def arrange(self, field: tf.Field) -> tf.Arranged:
            arranged = super().arrange(field)
            battery = {"tags": ["battery"], "battery_j": 1000.0}
            both = {"media": ["field", "backbone"]}
            changed = {f"c{i}": {**battery, **(both if i == 8 else {})} for i in (8, 9, 10)}
            return replace(arranged, processes=[replace(p, **changed.get(p.id, {})) for p in arranged.processes])

    backbone = {"backbone.model": "lognormal_prr", "backbone.radio": "wifi11b", "backbone.range_m": 1e7}
    plan = crying(Powered, **backbone, **{"backbone.noise_dbm": -180.0})
    spec = {p.id: p for p in plan.processes}
    assert spec["c1"].powers.keys() == {"field"}
    assert spec["c8"].powers["field"].listen_uw == 62_400
    assert spec["c9"].powers["field"].listen_uw == spec["c9"].powers["field"].sleep_uw == 6_000
    assert spec["c9"].powers["backbone"].listen_uw == 198_000
    ledger = simulated(plan)[0]
    cries = Counter(row.src for row in ledger.rows if row.medium == "backbone")
    heard = Counter(row.dst for row in ledger.rows if row.medium == "backbone" and row.delivered)
    assert cries["c9"] == heard["c9"] > 10
    for id in ("c8", "c9"):
        field, wire = (done(ledger.finals[id])[medium] for medium in ("field", "backbone"))
        assert field.send_ns == field.receive_ns == 0
        assert wire.send_ns > 6 * 400_000 < wire.receive_ns
        assert sum(field[:4]) == sum(wire[:4]) == plan.run.end_ns
