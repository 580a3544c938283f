"""A hand-over of almost 4 kB: one frame of the field, many fragments on the air, the same under both drivers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import pytest

from tests.test_drivers_agree import both, toy_plan
from trackfield.draw import uniform
from trackfield.drivers.spec import ProcessSpec, RunSpec, link_of, places_of
from trackfield.link.fate import Transmission
from trackfield.link.radios import RADIOS
from trackfield.role import NS, Effect, Event, Ignored, Publish, Received, Send, SetTimer, Started, Timer, TrackPoint
from trackfield.wire.codec import decode, encode
from trackfield.wire.error import WireError
from trackfield.wire.registry import MAX_BYTES, PLAIN_BYTES, Blob, Scaled, kind

SIZE = 3800
LINK = {"model": "lognormal_prr", "radio": "802154-0dbm", "noise_dbm": -98.0, "busy": 0.3, "ack": 3}


@kind(250, "handover")
@dataclass(frozen=True, slots=True)
class HandOver:
    step: Annotated[int, Scaled(0, 65535)]
    belief: Annotated[bytes, Blob(MAX_BYTES - PLAIN_BYTES)]


def belief(step: int) -> bytes:
    """Other bytes at each step."""
    return bytes(int(256 * uniform(1, "belief", step, n)) % 256 for n in range(SIZE))


class Giver:
    kinds: frozenset[str] = frozenset()

    def begin(self) -> int:
        return 0

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        match event:
            case Started(now) | Timer(now):
                sent = (Send(HandOver(state, belief(state)), "b"),) if state else ()
                return state + 1, (*sent, SetTimer("again", now + NS))
        return state, (Ignored("unexpected"),)


class Taker:
    kinds = frozenset({"handover"})

    def begin(self) -> float:
        return 0.0

    def handle(self, state: float, event: Event) -> tuple[float, tuple[Effect, ...]]:
        match event:
            case Received(_, HandOver(step, data), _):
                state = state / 2 + sum(byte * n for n, byte in enumerate(data))
                mean = (state, 0.0, 0.0, 0.0)
                return state, (Publish(TrackPoint("b", "t", step * NS, "tracking", mean, (0.0,) * 16, step=step)),)
        return state, ()


def pair() -> tuple[RunSpec, list[ProcessSpec]]:
    here = "tests.test_long_frames"
    a = ProcessSpec("a", "giver", f"{here}:Giver")
    b = ProcessSpec("b", "taker", f"{here}:Taker", x=15.0)
    return RunSpec("long", 3, 7 * NS, LINK, 5.0), [replace(a, peers=places_of([b])), replace(b, peers=places_of([a]))]


def test_it_is_fragmented_by_the_link() -> None:
    run, processes = pair()
    radio = RADIOS["802154-0dbm"](9)
    fate = link_of(run, processes).fate(Transmission("a", "b", "handover", NS, 0, SIZE))
    fragments = -(-SIZE // radio.payload_bytes)
    assert fragments > 30
    assert fate.attempts >= fragments
    assert fate.bytes_on_air >= SIZE + fragments * radio.overhead_bytes


@pytest.mark.parametrize("size", [0, SIZE, MAX_BYTES - PLAIN_BYTES])
def test_it_fits_a_payload(size: int) -> None:
    message = HandOver(65535, bytes(size))
    assert decode(encode(message)) == message


def test_a_longer_one_does_not() -> None:
    with pytest.raises(WireError, match="range"):
        encode(HandOver(1, bytes(MAX_BYTES - PLAIN_BYTES + 1)))


def test_it_passes_both_drivers(tmp_path: Path) -> None:
    real, found = both(toy_plan(*pair()), tmp_path)
    assert found == []
    frames = real.metrics["frames"]
    assert frames["by_kind"] == {"handover": {"sent": 6, "payload_bytes_max": len(encode(HandOver(1, bytes(SIZE))))}}
    assert frames["delivered"] >= 3
    assert real.metrics["bytes"]["on_air"] > 5 * SIZE
