"""Frames of peers that answer each other, in any order, late, more than once: all ends as if they had come in order."""

from __future__ import annotations

from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.network import LATER, field_of, sample_of, settle
from tests.toys import Request, party
from trackfield.drivers.engine.frames import Frame, Refused, Told, Undone
from trackfield.drivers.exchange.versions import Digest, digest
from trackfield.drivers.virtual import Virtual
from trackfield.wire.codec import encode

LINK: dict[str, Any] = {"model": "gilbert_elliott", "good_s": 1, "bad_s": 0.3, "delay_ms": 20, "jitter_ms": 30}


class Account:
    """The frames of a run in virtual time."""

    def __init__(self) -> None:
        self.frames: list[Frame] = []

    def sent(self, frame: Frame) -> None:
        self.frames.append(frame)

    def told(self, process: str, output: Told | Refused | Undone) -> None:
        pass

    def final(self, process: str, record: Any) -> None:
        pass


moves = st.lists(
    st.tuples(st.integers(0, 3), st.sampled_from(["come", "again", "handle", "catch up"]), st.integers(0, 99))
)


@settings(max_examples=150, deadline=None)
@given(moves, st.integers(1, 50))
def test_any_order_delay_and_repetition_end_as_the_ordered_run(moves: list[tuple[int, str, int]], seed: int) -> None:
    """However far a peer runs ahead of what it has yet to hear, all come to the states and frames of virtual time."""
    run, processes = party(3, steps=2, link=LINK, seed=seed)
    account = Account()
    virtual = Virtual(run, processes, account)
    virtual.run()
    field = field_of(run, processes)
    for who, what, index in moves:
        peer = list(field.values())[who]
        if what in ("come", "again") and peer.to_come:
            peer.come(index, again=what == "again")
        elif what == "catch up":
            peer.catch_up()
        elif what == "handle" and peer.due():
            peer.handle()
    settle(field)
    for id, peer in field.items():
        assert peer.core.state == virtual.cores[id].state
        assert peer.core.tally == virtual.cores[id].tally
        assert peer.core.host_late == 0
        mine = [frame for frame in account.frames if frame.src == id]
        assert peer.outgoing.live.size == len(mine)
        assert {f.identity: f for f in _live(peer)} == {f.identity: f for f in mine}


def _live(peer: Any) -> list[Frame]:
    return [frame for _, frame in peer.outgoing._left.values() if frame.payload]


@settings(max_examples=200)
@given(st.permutations([(v, p) for v in range(5) for p in range(2)]), st.lists(st.booleans(), min_size=5, max_size=5))
def test_the_highest_version_holds_whatever_the_order(order: list[tuple[int, int]], live: list[bool]) -> None:
    """Each of five versions of a frame comes twice; what is known then, and its digest, is the last, or nothing."""
    run, processes = party(1, steps=2, link={"model": "ideal"})
    hub = field_of(run, processes)["hub"]
    payloads = [encode(Request(version)) for version in range(5)]
    versions = [Frame("t00", 0, "request", 10**8, 0, "hub", "field", payload) for payload in payloads]
    for version, _ in order:
        frame = versions[version] if live[version] else versions[version].taken_back
        hub.incoming.take(sample_of(frame, version), LATER, run.end_ns)
    held = [one.frame for one in hub.core.waiting()]
    assert held == ([versions[4]] if live[4] else [])
    assert hub.incoming.heard == (digest([(versions[4], 4)]) if live[4] else Digest())
    assert hub.core.host_late == 0
