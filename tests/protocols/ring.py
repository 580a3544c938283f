"""A token passed round a ring every 20 ms; whoever has not seen it for long makes a new one.

Of two tokens the one of the higher generation lives; others are dropped where they meet it. Each member gives its own
generations, so that two who miss the token at once do not make the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from tests.protocols.chains import MS, Chain, Count, kept, known, next_step, run_of, told
from tests.toys import mix
from trackfield.drivers.spec import ProcessSpec, RunSpec, places_of
from trackfield.role import Effect, Event, Ignored, Received, Send, SetTimer, Started, Timer
from trackfield.wire.registry import kind

HOLD_NS: Final = 20 * MS
PATIENCE_NS: Final = 40 * MS
LOSS: Final = 0.03


@kind(246, "token")
@dataclass(frozen=True, slots=True)
class Token:
    """A token of a generation in its ``turn``-th hand."""

    generation: Count
    turn: Count
    chain: Chain


@dataclass(frozen=True)
class Hand:
    """The latest (generation, turn) that this member saw, and how many tokens it made."""

    chain: int
    seen: tuple[int, int] = (0, 0)
    made: int = 0


class Member:
    """The ``number``-th of ``size`` members, who hands the token to the ``next``."""

    kinds = frozenset({"token"})

    def __init__(self, *, name: str, number: int, size: int, next: str) -> None:
        self.name, self.number, self.size, self.next = name, number, size, next

    def begin(self) -> Hand:
        return Hand(self.number)

    def handle(self, state: Hand, event: Event) -> tuple[Hand, tuple[Effect, ...]]:
        match event:
            case Started(now):
                chain, generation, turn = known(event, state.chain, 0, 0)
                return Hand(chain, (generation, turn)), (next_step(now), self._watch(now))
            case Timer(now, "step"):
                return state, (told(self.name, now, state.chain), kept(state.chain, *state.seen), next_step(now))
            case Timer(now, "watch"):
                generation = (state.seen[0] // self.size + 1) * self.size + self.number
                state = Hand(mix(state.chain, generation), (generation, state.seen[1] + 1), state.made + 1)
                return state, (self._passed(state), self._watch(now))
            case Timer(now, "pass"):
                return state, (self._passed(state),)
            case Received(now, Token(generation, turn, chain), _):
                state = replace(state, chain=mix(state.chain, chain))
                if (generation, turn) <= state.seen:
                    return state, (Ignored("old"),)
                return replace(state, seen=(generation, turn)), (SetTimer("pass", now + HOLD_NS), self._watch(now))
        return state, (Ignored("unexpected"),)

    def _passed(self, state: Hand) -> Send:
        return Send(Token(state.seen[0], state.seen[1] + 1, state.chain), self.next)

    def _watch(self, now: int) -> SetTimer:
        """When to miss the token: after a round and a half, the first members first."""
        return SetTimer("watch", now + PATIENCE_NS * (self.size + self.number))


def party(
    seed: int, *, speed: float = 1.0, size: int = 8, seconds: int = 10, loss: float = LOSS
) -> tuple[RunSpec, list[ProcessSpec]]:
    """A ring of members, ready to run."""
    names = [f"m{i}" for i in range(size)]
    processes = [
        ProcessSpec(
            name,
            "member",
            "tests.protocols.ring:Member",
            {"name": name, "number": i, "size": size, "next": names[(i + 1) % size]},
            x=10.0 * i,
        )
        for i, name in enumerate(names)
    ]
    run = run_of("ring", seed, seconds, loss, speed)
    return run, [replace(p, peers=places_of([processes[i - 1]])) for i, p in enumerate(processes)]
