"""Energy and lifetimes of metrics.json, every figure by hand: two nodes, a centre, a few frames."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Any

import pytest

from launcher.record.figures.energy import batteries_of, energy_metrics, lifetime_metrics
from launcher.record.ledger import Ledger
from launcher.records import BATTERY, SENSES, TRACKS, FieldInfo, Place, Plan, Truth
from tests.simulated import simulated, spcpf
from trackfield.drivers.engine.frames import Died, Frame, Overflowed, Told
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.link.energy import DEVICES, Power
from trackfield.role import NS, Listen, Radio
from trackfield.world.path import Path

MS = 1_000_000
J = 10**15
"""A joule in fJ."""
POWER = Power(send_uw=70_000, receive_uw=50_000, listen_uw=40_000, sleep_uw=1000, sample_fj=J // 10**6, battery_fj=J)
"""70 mW, 50 mW, 40 mW, 1 mW; a microjoule per reading; a joule in the battery; 17 bytes and 32 us a byte."""
TEN, TWENTY = bytes(10), bytes(20)


def node(id: str, x: float, y: float, power: Power | None = POWER, **spec: Any) -> ProcessSpec:
    return ProcessSpec(id, "node", "none", x=x, y=y, power=asdict(power) if power else {}, **spec)


def plan_of(
    *processes: ProcessSpec, end_s: int = 10, reach_m: float = 50.0, truth: tuple[tuple[float, float, float], ...] = ()
) -> Plan:
    run = RunSpec("r", 1, end_s * NS, {"model": "fixed", "loss": 0.0, "delay_ms": 1})
    path = Path.of([(0.0, 0.0, 0.0, 1.0, 0.0), (9.0, 9.0, 0.0, 1.0, 0.0)])
    tags = {"node": frozenset({SENSES, BATTERY}), "fusion": frozenset({TRACKS})}
    places = tuple(Place(p.id, p.role, p.x, p.y, tags[p.role]) for p in processes)
    info = FieldInfo("r", "hand", places, (Truth("t", truth),), (), float(end_s))
    return Plan(run, processes, {"t": path}, info, reaches={p.id: reach_m for p in processes if p.role == "node"})


CENTRE = ProcessSpec("fusion", "fusion", "none", x=0.0, y=40.0, cells=("c0",))
N0, N1 = node("n0", 0.0, 0.0), node("n1", 30.0, 0.0)


def frame(t_ms: int, src: str, to: str, payload: bytes = TEN) -> Frame:
    return Frame(src, 0, "doa", t_ms * MS, 0, to, "field", payload)


def final(book: Ledger, name: str, *activity: int, metered_s: float = 10) -> None:
    """Milliseconds of sending, receiving, listening and sleep, and readings."""
    *times, samples = activity
    record = {"activity": {"field": [*(ms * MS for ms in times), samples]}, "metered_ns": round(metered_s * NS)}
    book.final(name, {**record, "inherited": {}})


def switch(book: Ledger, id: str, t_ms: int, on: bool) -> None:
    book.told(id, Told((t_ms * MS, 3, t_ms * MS, "t"), Radio(on)))


# --- by cause ---------------------------------------------------------------------------------------------------------


def test_what_is_spent_by_cause() -> None:
    plan = plan_of(CENTRE, N0, N1)
    book = Ledger(plan.run, plan.processes)
    final(book, "n0", 100, 200, 300, 9400, 50)
    final(book, "n1", 0, 100, 4900, 5000, 0)
    book.close()
    found = energy_metrics(plan, book, batteries_of(plan, book))
    n0 = {"send": 0.007, "receive": 0.01, "listen": 0.012, "sleep": 0.0094, "sense": 0.00005}
    n1 = {"send": 0.0, "receive": 0.005, "listen": 0.196, "sleep": 0.005, "sense": 0.0}
    assert found["by"] == pytest.approx({cause: n0[cause] + n1[cause] for cause in n0})
    assert found["total"] == pytest.approx(sum(n0.values()) + sum(n1.values()))
    assert found["max_node"] == pytest.approx(sum(n1.values()))
    assert found["by_accounting"]["metered"] == found["total"]
    assert found["by_role"] == {"node": pytest.approx(found["total"])}
    assert found["by_accounting"]["without_listening"] == pytest.approx(found["total"] - 0.208 + 5.2 * 0.001)


def test_nobody_counts_where_no_device_is_known() -> None:
    plan = plan_of(CENTRE, node("n0", 0.0, 0.0, None))
    book = Ledger(plan.run, plan.processes)
    nodes = batteries_of(plan, book)
    assert nodes == []
    found = energy_metrics(plan, book, nodes)
    assert found.pop("by_role") == {}
    assert {*found.pop("by").values(), *found.pop("by_accounting").values(), *found.values()} == {None}
    assert set(lifetime_metrics(plan, nodes).values()) == {None}


def test_what_each_role_spent() -> None:
    plan = plan_of(CENTRE, N0, N1)
    places = [replace(place, role="master") if place.id == "n1" else place for place in plan.info.places]
    plan = replace(plan, info=replace(plan.info, places=tuple(places)))
    book = Ledger(plan.run, plan.processes)
    final(book, "n0", 100, 0, 0, 9900, 0)
    final(book, "n1", 0, 0, 1000, 9000, 0)
    found = energy_metrics(plan, book, batteries_of(plan, book))
    assert found["by_role"] == pytest.approx({"master": 0.049, "node": 0.0169})


def test_all_lives_of_a_node_are_one() -> None:
    """The second life inherits what the first one spent; it is counted once."""
    lives = replace(N0, kill_ns=4 * NS), replace(N0, incarnation=1, start_ns=6 * NS)
    plan = plan_of(CENTRE, *lives)
    book = Ledger(plan.run, plan.processes)
    final(book, "n0", 100, 0, 3900, 0, 1, metered_s=4)
    final(book, "n0~1", 0, 100, 3900, 0, 2, metered_s=4)
    book.told("n0~1", Told((9 * NS, 3), Died("battery")))
    [one] = batteries_of(plan, book)
    assert one.activity == (100 * MS, 100 * MS, 7800 * MS, 0, 3)
    assert (one.metered_ns, one.died_ns) == (8 * NS, 9 * NS)


# --- other accountings ------------------------------------------------------------------------------------------------


def test_overhearing_is_paid_by_whose_radio_is_on_and_for_whom_the_frame_was_not() -> None:
    """n0 and n1 send 10 bytes each to the centre. n0's is heard by n1 as well, but when n1 sends, n0 is asleep."""
    plan = plan_of(CENTRE, N0, N1)
    book = Ledger(plan.run, plan.processes)
    switch(book, "n0", 500, on=False)
    book.sent(frame(400, "n0", "fusion"))
    book.sent(frame(600, "n1", "fusion"))
    final(book, "n0", 0, 0, 500, 9500, 0)
    final(book, "n1", 0, 0, 10_000, 0, 0)
    book.close()
    found = energy_metrics(plan, book, batteries_of(plan, book))["by_accounting"]
    heard = (10 + 17) * 32e-6 * (0.050 - 0.001)
    assert found["without_listening"] == pytest.approx(20 * 0.001)
    assert found["with_overhearing"] == pytest.approx(20 * 0.001 + heard)


def test_a_radio_that_is_on_for_nothing_is_cheaper_in_no_accounting() -> None:
    """A node sleeps for ten seconds or listens all the while."""
    found = []
    for activity in ((0, 0, 0, 10_000, 0), (0, 0, 10_000, 0, 0)):
        plan = plan_of(CENTRE, N0)
        book = Ledger(plan.run, plan.processes)
        final(book, "n0", *activity)
        book.close()
        found.append(energy_metrics(plan, book, batteries_of(plan, book))["by_accounting"])
    asleep, listening = found
    assert all(listening[name] >= asleep[name] for name in asleep)
    assert listening["without_listening"] == asleep["without_listening"] == pytest.approx(0.01)


def overheard(
    *told: tuple[str, Told], processes: tuple[ProcessSpec, ...] = (CENTRE, N0, N1), t_ms: int = 400, longer_ms: int = 0
) -> float:
    """How many times 27 bytes are overheard when n0 sends 10 bytes to the centre."""
    plan = plan_of(*processes)
    book = Ledger(plan.run, plan.processes)
    for name, output in told:
        book.told(name, output)
    book.sent(replace(frame(t_ms, "n0", "fusion"), preamble_ns=longer_ms * MS))
    book.close()
    spent: float = energy_metrics(plan, book, batteries_of(plan, book))["by_accounting"]["with_overhearing"]
    return spent / (27 * 32e-6 * 0.049)


@pytest.mark.parametrize(("t_ms", "count"), [(99, 1), (100, 0), (299, 0), (300, 1), (400, 1), (401, 0), (500, 0)])
def test_who_stands_still_or_is_dead_overhears_nothing(t_ms: int, count: int) -> None:
    """n1 stands still from 100 to 300 ms, and its battery is empty after 400."""
    still = (CENTRE, N0, replace(N1, freezes=((100 * MS, 300 * MS),)))
    death = ("n1", Told((400 * MS, 3), Died("battery")))
    assert overheard(death, processes=still, t_ms=t_ms) == pytest.approx(count)


@pytest.mark.parametrize(("t_ms", "count"), [(199, 1), (200, 0), (299, 0), (300, 1), (350, 1), (351, 0)])
def test_each_life_begins_with_its_radio_on(t_ms: int, count: int) -> None:
    lives = replace(N1, kill_ns=200 * MS), replace(N1, incarnation=1, start_ns=300 * MS)
    off = ("n1~1", Told((350 * MS, 3, 350 * MS, "t"), Radio(False)))
    assert overheard(off, processes=(CENTRE, N0, *lives), t_ms=t_ms) == pytest.approx(count)


def test_a_radio_that_was_never_switched_before_was_on() -> None:
    switched = ("n1", Told((500 * MS, 3, 500 * MS, "t"), Radio(False)))
    assert overheard(switched, t_ms=400) == pytest.approx(1)
    assert overheard(switched, t_ms=501) == 0


@pytest.mark.parametrize(
    ("t_ms", "longer_ms", "count"), [(400, 0, 1), (402, 0, 1), (404, 0, 0), (450, 0, 0), (450, 60, 10.864 / 0.864)]
)
def test_in_windows_a_radio_overhears_what_it_catches_from_then_on(t_ms: int, longer_ms: int, count: float) -> None:
    """Open for 3 ms every 100 ms; a longer preamble is heard from the next window on, with the frame of 0.864 ms."""
    windows = ("n1", Told((0, 3, 0, "t"), Listen(100 * MS, 3 * MS, 0)))
    assert overheard(windows, t_ms=t_ms, longer_ms=longer_ms) == pytest.approx(count)


def test_on_another_medium_the_device_for_it_overhears() -> None:
    other = replace(POWER, receive_uw=9_000, sleep_uw=2_000)
    both = [replace(p, media=("field", "air")) for p in (CENTRE, N0, N1)]
    specs = [both[0], both[1], replace(both[2], devices={"air": asdict(other)})]
    plan = plan_of(*specs)
    plan = replace(plan, run=replace(plan.run, media={"air": {"model": "ideal"}}))
    book = Ledger(plan.run, plan.processes)
    book.sent(replace(frame(400, "n0", "fusion"), medium="air"))
    book.close()
    spent: float = energy_metrics(plan, book, batteries_of(plan, book))["by_accounting"]["with_overhearing"]
    assert spent == pytest.approx(27 * 32e-6 * 0.007)


def test_whoever_a_broadcast_is_for_does_not_overhear_it() -> None:
    """It is for n0, n1 and n2: they pay for it as received; n3, in the same reach, does not listen to that cell."""
    nodes = [replace(node(f"n{i}", 10.0 * i, 0.0), cells=("c0",) if i < 3 else ()) for i in range(4)]
    plan = plan_of(CENTRE, *nodes)
    book = Ledger(plan.run, plan.processes)
    book.sent(frame(400, "fusion", "*"))
    book.close()
    assert [row.dst for row in book.rows] == ["n0", "n1", "n2"]
    found = energy_metrics(plan, book, batteries_of(plan, book))["by_accounting"]
    assert found["with_overhearing"] == pytest.approx(27 * 32e-6 * 0.049)


def test_the_first_order_model_counts_bits_and_metres_alone() -> None:
    """n0 is 40 m from the centre, n1 50 m; the centre's answer of 20 bytes costs n0 its reception."""
    plan = plan_of(CENTRE, N0, N1)
    book = Ledger(plan.run, plan.processes)
    book.sent(frame(400, "n0", "fusion"))
    book.sent(frame(500, "n1", "fusion"))
    book.sent(frame(600, "fusion", "n0", TWENTY))
    book.told("n1", Told((0, 2, 0, "t"), Overflowed(frame(700, "n1", "fusion"))))
    final(book, "n0", 1, 1, 1, 1, 1)
    book.close()
    found = energy_metrics(plan, book, batteries_of(plan, book))["by_accounting"]["first_order"]
    send = 80 * (50e-9 + 10e-12 * 40**2) + 80 * (50e-9 + 10e-12 * 50**2)
    assert found == pytest.approx(send + 160 * 50e-9)


def test_each_device_would_have_drawn_what_its_own_frames_take() -> None:
    """n0 sends 10 bytes and 20, hears 20, listens for a second and sleeps for nine."""
    plan = plan_of(CENTRE, N0)
    book = Ledger(plan.run, plan.processes)
    book.sent(frame(400, "n0", "fusion"))
    book.sent(frame(500, "n0", "fusion", TWENTY))
    book.sent(frame(600, "fusion", "n0", TWENTY))
    final(book, "n0", 5, 5, 1000, 9000, 3)
    book.close()
    found = energy_metrics(plan, book, batteries_of(plan, book))["by_accounting"]
    for name, device in DEVICES.items():
        head, byte_s = device.overhead_bytes, device.byte_ns * 1e-9
        send = (30 + 2 * head) * byte_s * device.send_uw * 1e-6
        receive = (20 + head) * byte_s * device.receive_uw * 1e-6
        assert found[name] == pytest.approx(send + receive + device.listen_uw * 1e-6 + 9 * device.sleep_uw * 1e-6)


# --- lifetimes --------------------------------------------------------------------------------------------------------

FOUR = [node(f"n{i}", 100.0 * i, 0.0) for i in range(4)]


def lifetimes(*died_s: float | None, reach_m: float = 120.0, **spent_ms: int) -> dict[str, Any]:
    """Of four nodes 100 m apart; the target goes from the first to the last; ``spent_ms`` is of listening, at 40 mW."""
    plan = plan_of(
        CENTRE, *FOUR, truth=tuple((t, 100.0 * t, 0.0) for t in (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0)), reach_m=reach_m
    )
    book = Ledger(plan.run, plan.processes)
    for each, t in zip(FOUR, died_s, strict=True):
        if t is not None:
            book.told(each.id, Told((round(t * NS), 3), Died("battery")))
        final(book, each.id, 0, 0, spent_ms.get(each.id, 1000), 0, 0)
    return lifetime_metrics(plan, batteries_of(plan, book))


def test_measured_lifetimes() -> None:
    """Died at 2, 4, 6 and 8 s; at x = 0 n0 and n1 hear the target, and the later of them died at 4 s."""
    assert lifetimes(2, 4, 6, 8) == {
        "first_death": 2.0, "half_dead": 4.0, "coverage_lost": 4.0, "extrapolated": False,
        "empty": [{"id": f"n{i}", "t": 2.0 * i + 2.0} for i in range(4)],
    }  # fmt: skip


def test_extrapolated_lifetimes() -> None:
    """n3 spent 40 mJ of its joule in 10 s, and so lasts for 250 s; n2, with twice that, for 125 s."""
    found = lifetimes(2, None, None, None, n1=4000, n2=2000, n3=1000)
    assert found == {
        "first_death": 2.0, "half_dead": pytest.approx(62.5), "coverage_lost": pytest.approx(62.5),
        "extrapolated": True, "empty": [{"id": "n0", "t": 2.0}],
    }  # fmt: skip


def test_a_place_where_nobody_ever_heard_the_target_is_not_lost() -> None:
    """With a reach of 40 m the target is heard near the nodes only, by one node each."""
    assert lifetimes(8, 2, 4, 6, reach_m=40.0)["coverage_lost"] == 2.0
    assert lifetimes(8, 2, 4, 6, reach_m=60.0)["coverage_lost"] == 2.0  # at x = 100 m, by n1 alone
    assert lifetimes(8, 2, 4, 6, reach_m=0.0)["coverage_lost"] == 2.0
    assert lifetimes(2, 4, 6, 8, reach_m=1000.0)["coverage_lost"] == 8.0


def test_a_node_that_was_killed_has_no_lifetime_to_extrapolate() -> None:
    """It lived for a short and busy time; what is left of its battery nobody draws."""
    killed = replace(FOUR[0], kill_ns=NS)
    plan = plan_of(CENTRE, killed, *FOUR[1:], truth=((0.0, 0.0, 0.0), (3.0, 300.0, 0.0)), reach_m=120.0)
    book = Ledger(plan.run, plan.processes)
    for each, listened_ms in ((killed, 4000), *((one, 1000) for one in FOUR[1:])):
        final(book, each.id, 0, 0, listened_ms, 0, 0)
    found = lifetime_metrics(plan, batteries_of(plan, book))
    assert found["first_death"] == found["coverage_lost"] == pytest.approx(250.0)  # n1 covers what n0 does no more


def test_on_mains_nobody_dies_and_no_place_is_lost_that_one_of_them_covers() -> None:
    mains = replace(POWER, battery_fj=None)
    plan = plan_of(CENTRE, node("n0", 0.0, 0.0), node("n1", 10.0, 0.0, mains), truth=((0.0, 0.0, 0.0),))
    book = Ledger(plan.run, plan.processes)
    final(book, "n0", 0, 0, 1000, 0, 0)
    final(book, "n1", 0, 0, 1000, 0, 0)
    assert lifetime_metrics(plan, batteries_of(plan, book)) == {
        "first_death": pytest.approx(250.0), "half_dead": pytest.approx(250.0), "coverage_lost": None,
        "extrapolated": True, "empty": [],
    }  # fmt: skip
    book = Ledger(plan.run, (CENTRE, node("n1", 10.0, 0.0, mains)))
    assert set(lifetime_metrics(plan, batteries_of(plan, book)).values()) == {None}


# --- a run ------------------------------------------------------------------------------------------------------------


def test_what_a_run_spends_is_what_its_nodes_say() -> None:
    """Nodes that sleep until they hear something: the parts make the whole, and none of them is up for longer."""
    plan = spcpf(1, ["target.steps=10", "energy.battery_j=0.05", "clock.offset_ms=20"])
    book, _ = simulated(plan)
    nodes = batteries_of(plan, book)
    found = energy_metrics(plan, book, nodes)
    assert found["total"] == pytest.approx(sum(found["by"].values()))
    listened_j = sum(one.activity.listen_ns * (one.power.listen_uw - one.power.sleep_uw) for one in nodes) / J
    assert found["by_accounting"]["without_listening"] == pytest.approx(found["total"] - listened_j)
    assert listened_j > 0
    assert all(sum(one.activity[:4]) == one.metered_ns for one in nodes)
    assert all(sum(one.spent_j.values()) < 0.05 * 1.01 for one in nodes)
    assert {one.died_ns is not None for one in nodes} == {True}
    lasting = lifetime_metrics(plan, nodes)
    assert 0 < lasting["first_death"] <= lasting["half_dead"] <= 11
    assert lasting["extrapolated"] is False
