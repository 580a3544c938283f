"""What a recorder leaves and tells while a run goes on: the timeline has what holds, the status what is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher.record.journal import Journal, summary, written
from launcher.record.ledger import Ledger
from launcher.records import TRACKS, Place, Plan, View
from tests.rrd import read
from tests.tiny import COVARIANCE, MS, tiny
from trackfield.drivers.engine.frames import RANK_TIMER, EventKey, Frame, Telling, Told, Undone
from trackfield.drivers.spec import ProcessSpec
from trackfield.role import NS, Note, Publish, State, TrackPoint, Write
from trackfield.wire.codec import encode
from trackfield.wire.messages import Doa


def frame(t_ms: int, payload: bytes | None = None) -> Frame:
    payload = encode(Doa(1, 90.0, 60.0)) if payload is None else payload
    return Frame("n0", 0, "doa", t_ms * MS, 0, "fusion", "field", payload)


def key(t_ms: int) -> EventKey:
    return (t_ms * MS, RANK_TIMER, t_ms * MS, "t")


def told(t_ms: int, effect: Telling) -> Told:
    return Told(key(t_ms), effect)


def published(x: float) -> Publish:
    return Publish(TrackPoint("t", "target", NS, "tracking", (x, 0.0, 1.0, 0.0), COVARIANCE, step=1, source="fusion"))


@pytest.fixture
def plan() -> Plan:
    return tiny()


@pytest.fixture
def journal(plan: Plan, tmp_path: Path) -> Journal:
    return Journal(plan, Ledger(plan.run, plan.processes), tmp_path)


def test_the_timeline_has_nothing_of_what_was_taken_back(journal: Journal, tmp_path: Path) -> None:
    """Seen and undone before it was settled; what holds is drawn."""
    ledger = journal.ledger
    for t_ms in (1000, 1500):
        ledger.sent(frame(t_ms), 0)
        ledger.told("n0", told(t_ms, Note(f"sent at {t_ms}")))
    journal.settle(1400 * MS)
    ledger.sent(frame(1500, b""), 1)
    ledger.told("n0", Undone(key(1500)))
    ledger.told("n0", told(1500, Note("did not send")))
    metrics = journal.tables([], messages=3)
    assert journal.draw() == ""
    file = tmp_path / "run.rrd"
    assert len(read(file, "/messages/doa", "TextLog:text")) == 1
    assert [text for _, (text,) in read(file, "/notes", "TextLog:text")] == ["n0: sent at 1000", "n0: did not send"]
    assert (metrics["frames"]["sent"], metrics["recorder"]["complaints"]) == (1, [])


def test_bytes_at_a_port_are_a_note(journal: Journal, tmp_path: Path) -> None:
    for t_ms, data in ((1000, b"\x88\x30\x01\xff"), (1100, b""), (1200, bytes(4096)), (1300, b"!")):
        journal.ledger.told("n0", told(t_ms, Write("tty\n", data)))
    journal.tables([], messages=4)
    assert journal.draw() == ""
    notes = [text for _, (text,) in read(tmp_path / "run.rrd", "/notes", "TextLog:text")]
    assert notes == [
        r"n0: wrote 4 bytes to tty\n: 88 30 01 ff", r"n0: wrote 0 bytes to tty\n",
        rf"n0: wrote 4096 bytes to tty\n: {'00 ' * 32}...", r"n0: wrote 1 byte to tty\n: 21",
    ]  # fmt: skip


@given(st.text(max_size=500), st.binary(max_size=5000))
def test_bytes_at_any_port_are_one_short_line(port: str, data: bytes) -> None:
    said = written(port, data)
    assert said.isprintable() or not port.isprintable()
    assert len(said.splitlines()) == 1
    assert len(said) < 200


def test_the_status_is_of_now_although_nothing_is_settled(journal: Journal) -> None:
    ledger = journal.ledger
    ledger.sent(frame(1000), 0)
    ledger.sent(frame(1500), 0)
    for t_ms, name in ((900, "idle"), (1000, "reporting")):
        ledger.told("n0", told(t_ms, State(name)))
    ledger.told("fusion", told(1300, published(4.0)))
    now = {
        "sent": 2, "outcomes": {"delivered": 2}, "states": {"reporting": 1}, "errors": {"t": pytest.approx(3.0)}
    }  # fmt: skip
    assert summary(journal, 2 * NS) == now
    journal.settle(1200 * MS)
    assert summary(journal, 2 * NS) == now
    ledger.sent(frame(1500, b""), 1)
    ledger.told("fusion", Undone(key(1300)))
    ledger.told("fusion", told(1300, published(1.5)))
    now |= {"sent": 1, "outcomes": {"delivered": 1}, "errors": {"t": pytest.approx(0.5)}}
    assert summary(journal, 2 * NS) == now
    journal.settle(4 * NS)
    assert summary(journal, 4 * NS) == now


def test_what_the_recorder_never_got_is_among_its_complaints(journal: Journal) -> None:
    journal.ledger.final("n0", {"told": 2})
    metrics = journal.tables([], messages=0)
    assert metrics["recorder"]["complaints"] == [
        "2 pieces of telemetry never reached the recorder: states or tracks may be missing"
    ]


def test_the_error_is_that_of_the_first_view(plan: Plan, tmp_path: Path) -> None:
    """Whoever else publishes the track, such as a base that knows it later, does not count."""
    places = (*plan.info.places, Place("base", "base", 0.0, 0.0, frozenset({TRACKS})))
    views = (*plan.views, View("other", ("base",)))
    own = Journal(
        replace(plan, info=replace(plan.info, places=places), views=views),
        Ledger(plan.run, (*plan.processes, ProcessSpec("base", "base", "none"))),
        tmp_path,
    )
    first = published(4.0)
    later = Publish(replace(first.estimate, source="base", mean=(9.0, 0.0, 1.0, 0.0)))
    own.ledger.told("fusion", told(1300, first))
    own.ledger.told("base", told(1400, later))
    assert summary(own, 2 * NS)["errors"] == {"t": pytest.approx(3.0)}
    own.settle(2 * NS)
    assert summary(own, 2 * NS)["errors"] == {"t": pytest.approx(3.0)}
