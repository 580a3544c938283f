"""Processes of two roles each, which talk to each other at once and to those of other processes by radio.

Each ``Asker`` asks the ``Answerer`` of its own process, and in the same breath that of a peer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from tests.protocols.chains import MS, Chain, acquainted, kept, known, next_step, run_of, told
from tests.toys import mix
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.role import Effect, Event, Ignored, Received, Send, SetTimer, Started, Timer
from trackfield.wire.registry import kind

LOSS: Final = 0.1


@kind(247, "ask")
@dataclass(frozen=True, slots=True)
class Ask:
    """A question."""

    chain: Chain


@kind(248, "answer")
@dataclass(frozen=True, slots=True)
class Answer:
    """What follows from a question and all those before it."""

    chain: Chain


@dataclass(frozen=True)
class Mind:
    """All that a role knows."""

    chain: int


class Asker:
    """Asks every 40 to 80 ms, as the answers decide."""

    kinds = frozenset({"answer"})

    def __init__(self, *, name: str, number: int, peers: Sequence[str]) -> None:
        self.name, self.number, self.peers = name, number, tuple(peers)

    def begin(self) -> Mind:
        return Mind(self.number)

    def handle(self, state: Mind, event: Event) -> tuple[Mind, tuple[Effect, ...]]:
        match event:
            case Started(now):
                return Mind(*known(event, state.chain)), (next_step(now), SetTimer("ask", now + 30 * MS))
            case Timer(now, "step"):
                return state, (told(self.name, now, state.chain), kept(state.chain), next_step(now))
            case Timer(now, "ask"):
                peer = self.peers[state.chain % len(self.peers)]
                again = SetTimer("ask", now + (40 + state.chain % 5 * 10) * MS)
                return state, (Send(Ask(state.chain), frozenset({self.name, peer})), again)
            case Received(_, Answer(chain), _):
                return Mind(mix(state.chain, chain)), ()
        return state, (Ignored("unexpected"),)


class Answerer:
    """Answers at once."""

    kinds = frozenset({"ask"})

    def __init__(self, *, number: int) -> None:
        self.number = number

    def begin(self) -> Mind:
        return Mind(self.number)

    def handle(self, state: Mind, event: Event) -> tuple[Mind, tuple[Effect, ...]]:
        match event:
            case Started():
                return Mind(*known(event, state.chain)), ()
            case Received(_, Ask(chain), sender):
                state = Mind(mix(state.chain, chain))
                return state, (Send(Answer(state.chain), sender), kept(state.chain))
        return state, (Ignored("unexpected"),)


def party(
    seed: int, *, speed: float = 1.0, size: int = 2, seconds: int = 10, loss: float = LOSS
) -> tuple[RunSpec, list[ProcessSpec]]:
    """Pairs that all ask each other, ready to run."""
    names = [f"p{i}" for i in range(size)]
    processes = [
        ProcessSpec(
            name,
            "pair",
            "asker=tests.protocols.hosted:Asker,answerer=tests.protocols.hosted:Answerer",
            {
                "asker": {"name": name, "number": i, "peers": [other for other in names if other != name]},
                "answerer": {"number": 100 + i},
            },
            x=10.0 * i,
        )
        for i, name in enumerate(names)
    ]
    run = run_of("hosted", seed, seconds, loss, speed)
    return run, acquainted(processes)
