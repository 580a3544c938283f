"""A field on the radio: who needs to know which places, and that ledger and receivers agree on every fate."""

from __future__ import annotations

from typing import Any

import msgpack
import pytest

from launcher.plan.forecast.reception import receptions
from launcher.record.ledger import Ledger
from tests.simulated import simulated, spcpf
from tests.toys import party
from trackfield.drivers.spec import ProcessSpec, places_of
from trackfield.drivers.virtual import Virtual
from trackfield.link import make_link
from trackfield.link.fate import Transmission

RADIO: dict[str, Any] = {
    "model": "lognormal_prr", "radio": "802154-0dbm", "noise_dbm": -98.0, "busy": 0.3, "ack": 2,
}  # fmt: skip
SHORT = ["target.steps=20", "link.model=lognormal_prr"]


def answer(process: ProcessSpec) -> bytes:
    return bytes(msgpack.packb(process.plain()))


def test_a_place_travels_in_a_join_answer() -> None:
    for process in spcpf(1, SHORT).processes[:2]:
        travelled = ProcessSpec.from_plain(msgpack.unpackb(answer(process)), process.factory)
        assert travelled == ProcessSpec.from_plain(process.plain(), process.factory)
        assert travelled.peers == process.peers
        assert travelled.places == {**process.peers, process.id: (process.x, process.y)}


def test_what_a_node_is_told_does_not_grow_with_the_field() -> None:
    small, large = (spcpf(1, [*SHORT, f"field.nodes={n}"]).processes for n in (100, 1000))
    for centre, node, *_ in (small, large):
        assert node.peers == places_of([centre])
        assert len(answer(node)) < 1500
    assert len(large[0].peers) == len(large) - 1
    assert len(answer(large[0])) < 100_000


def test_every_process_knows_the_fates_of_its_own_frames() -> None:
    """What a process computes from its peers is what the recorder computes from all places."""
    plan = spcpf(1, SHORT)
    whole = make_link(plan.run.link, plan.run.seed, places_of(plan.processes))
    centre, *nodes = plan.processes
    mine = make_link(plan.run.link, plan.run.seed, centre.places)
    for node in nodes:
        theirs = make_link(plan.run.link, plan.run.seed, node.places)
        there, back = (node.id, centre.id, "doa", 10**9, 0, 12), (centre.id, node.id, "doa", 10**9, 0, 12)
        assert mine.fate(Transmission(*there)) == whole.fate(Transmission(*there))
        assert theirs.fate(Transmission(*back)) == whole.fate(Transmission(*back))


@pytest.mark.parametrize("radio", ["802154-0dbm", "802154-20dbm", "lora868", "wifi11b", "mica2"])
def test_ledger_and_receivers_agree(radio: str) -> None:
    plan = spcpf(2, [*SHORT, f"link.radio={radio}"])
    ledger, _ = simulated(plan)
    assert ledger.sums()["host_lost"] == 0
    arrived = sum(row.delivered for row in ledger.rows)
    assert arrived == ledger.finals["fusion"].get("delivered", 0)
    assert len(ledger.rows) == arrived + sum(row.outcome in ("radio", "in_flight") for row in ledger.rows)


def test_ledger_and_receivers_agree_on_broadcasts_and_replies() -> None:
    run, processes = party(8, steps=20, link=RADIO)
    ledger = Ledger(run, processes)
    virtual = Virtual(run, processes, ledger)
    virtual.run()
    for id, core in virtual.cores.items():
        ledger.final(id, {"sent": ledger.sent_by[id], **core.tally})
    ledger.close()
    assert ledger.sums()["host_lost"] == 0
    assert {row.outcome for row in ledger.rows} >= {"delivered", "radio"}
    for process in processes:
        arrived = sum(row.delivered for row in ledger.rows if row.dst == process.id)
        assert arrived == ledger.finals[process.id]["delivered"]


def test_the_reception_that_a_user_is_told_is_what_the_reports_meet() -> None:
    """Far from half, links of a lognormal field either work or do not: their frames say the same as ``validate``."""
    plan = spcpf(1, ["link.radio=802154-0dbm"])
    shares = receptions(plan)["doa"]
    ledger, _ = simulated(plan)
    clear = [row for row in ledger.rows if not 0.001 < shares[row.src, row.dst] < 0.9999]
    assert len(clear) > 50
    assert all(row.delivered == (shares[row.src, row.dst] > 0.5) for row in clear)
