"""A relay over several hops, each acknowledged by the protocol, not by the radio.

The source makes items; every station hands each item to the next and repeats that until it is acknowledged, or six
times. It acknowledges every item that it gets, and tells by their numbers those that it has had before.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Final

from tests.protocols.chains import MS, Chain, kept, known, next_step, run_of, told
from tests.toys import mix
from trackfield.drivers.spec import ProcessSpec, RunSpec, places_of
from trackfield.role import CancelTimer, Effect, Event, Ignored, Received, Send, SetTimer, Started, Timer
from trackfield.wire.registry import Scaled, kind

TRIES: Final = 6
PATIENCE_NS: Final = 25 * MS
REMEMBERED: Final = 64
LOSS: Final = 0.2

Number = Annotated[int, Scaled(0, 65535)]


@kind(244, "parcel")
@dataclass(frozen=True, slots=True)
class Item:
    """The ``number``-th item of the source."""

    number: Number
    chain: Chain


@kind(245, "taken")
@dataclass(frozen=True, slots=True)
class Taken:
    """The acknowledgement of an item."""

    number: Number
    chain: Chain


@dataclass(frozen=True)
class Shelf:
    """``made`` items so far (of the source), the (number, tries) of those under way, and the numbers it has had."""

    chain: int
    made: int = 0
    under_way: tuple[tuple[int, int], ...] = ()
    had: tuple[int, ...] = ()


class Station:
    """One of the line: the source has no station ``before`` it, the sink none ``after``."""

    kinds = frozenset({"parcel", "taken"})

    def __init__(self, *, name: str, number: int, before: str, after: str) -> None:
        self.name, self.number, self.before, self.after = name, number, before, after

    def begin(self) -> Shelf:
        return Shelf(self.number)

    def handle(self, state: Shelf, event: Event) -> tuple[Shelf, tuple[Effect, ...]]:
        match event:
            case Started(now):
                chain, made = known(event, state.chain, 0)
                make = () if self.before else (SetTimer("make", now + 40 * MS),)
                return Shelf(chain, made), (next_step(now), *make)
            case Timer(now, "step"):
                return state, (told(self.name, now, state.chain), kept(state.chain, state.made), next_step(now))
            case Timer(now, "make"):
                state, effects = self._handed(replace(state, made=state.made + 1), state.made + 1, 1, now)
                again = SetTimer("make", now + (60 + state.chain % 5 * 8) * MS)
                return state, (*effects, kept(state.chain, state.made), again)
            case Timer(now, name):
                number = int(name)
                return self._handed(state, number, dict(state.under_way)[number] + 1, now)
            case Received(now, Item(number, chain), self.before):
                return self._got(replace(state, chain=mix(state.chain, chain)), number, now)
            case Received(_, Taken(number, chain), self.after):
                return self._done(replace(state, chain=mix(state.chain, chain)), number), (CancelTimer(str(number)),)
        return state, (Ignored("unexpected"),)

    def _handed(self, state: Shelf, number: int, tries: int, now: int) -> tuple[Shelf, tuple[Effect, ...]]:
        """An item sent for the ``tries``-th time, or given up."""
        state = self._done(state, number)
        if tries > TRIES:
            return replace(state, chain=mix(state.chain, number)), ()
        item = Send(Item(number, mix(state.chain, tries)), self.after)
        again = SetTimer(str(number), now + PATIENCE_NS + state.chain % 7 * MS)
        return replace(state, under_way=(*state.under_way, (number, tries))), (item, again)

    def _got(self, state: Shelf, number: int, now: int) -> tuple[Shelf, tuple[Effect, ...]]:
        taken = Send(Taken(number, state.chain), self.before)
        if number in state.had:
            return state, (taken, Ignored("repeated"))
        state = replace(state, had=(*state.had, number)[-REMEMBERED:])
        state, effects = self._handed(state, number, 1, now) if self.after else (state, ())
        return state, (taken, *effects)

    @staticmethod
    def _done(state: Shelf, number: int) -> Shelf:
        return replace(state, under_way=tuple(one for one in state.under_way if one[0] != number))


def party(
    seed: int, *, speed: float = 1.0, size: int = 4, seconds: int = 10, loss: float = LOSS
) -> tuple[RunSpec, list[ProcessSpec]]:
    """A line of stations from source to sink, ready to run."""
    names = ["source", *(f"r{i}" for i in range(1, size - 1)), "sink"]
    processes = [
        ProcessSpec(
            name,
            "station",
            "tests.protocols.relay:Station",
            {"name": name, "number": i, "before": before, "after": after},
            x=10.0 * i,
        )
        for i, (before, name, after) in enumerate(zip(["", *names], names, [*names[1:], ""], strict=False))
    ]
    around = [[p for p in processes if p.id in (one.config["before"], one.config["after"])] for one in processes]
    run = run_of("relay", seed, seconds, loss, speed)
    return run, [replace(p, peers=places_of(others)) for p, others in zip(processes, around, strict=True)]
