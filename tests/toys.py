"""Roles that talk back: a wrong order of events anywhere shows in everything that follows.

Each keeps a chain, a number that every message changes in a way that depends on the order. ``Talker``s ask the
``Hub`` once a step, at an instant that the last feedback decided; the hub answers each at once, and broadcasts its own
chain every step. An answer depends on the request alone: one that depended on what else came at that instant could not
be right before all of it is there, under any driver in real time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from trackfield.drivers.spec import ProcessSpec, RunSpec, places_of
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    Effect,
    Event,
    Ignored,
    Publish,
    Received,
    Send,
    SetTimer,
    Started,
    Timer,
    TrackPoint,
)
from trackfield.wire.registry import Scaled, kind

MODULUS = 65521


@kind(240, "request")
@dataclass(frozen=True, slots=True)
class Request:
    chain: Annotated[int, Scaled(0, MODULUS)]


@kind(241, "reply")
@dataclass(frozen=True, slots=True)
class Reply:
    chain: Annotated[int, Scaled(0, MODULUS)]


@kind(242, "feedback")
@dataclass(frozen=True, slots=True)
class Feedback:
    step: Annotated[int, Scaled(0, 65535)]
    chain: Annotated[int, Scaled(0, MODULUS)]


def mix(chain: int, value: int) -> int:
    return (chain * 31 + value + 1) % MODULUS


@dataclass(frozen=True)
class Toy:
    chain: int = 1
    step: int = 0


def _told(tracker: str, toy: Toy) -> Publish:
    return Publish(
        TrackPoint(
            tracker, "t", toy.step * NS, "tracking", (float(toy.chain), 0.0, 0.0, 0.0), (0.0,) * 16, step=toy.step
        )
    )


class Hub:
    kinds = frozenset({"request"})

    def __init__(self, *, step_ns: int = NS) -> None:
        self.step_ns = step_ns

    def begin(self) -> Toy:
        return Toy()

    def handle(self, state: Toy, event: Event) -> tuple[Toy, tuple[Effect, ...]]:
        match event:
            case Started():
                return state, (SetTimer("step", self.step_ns),)
            case Timer(now):
                state = replace(state, step=state.step + 1)
                feedback = Send(Feedback(state.step, state.chain), NEIGHBOURHOOD)
                return state, (feedback, _told("hub", state), SetTimer("step", now + self.step_ns))
            case Received(_, Request(chain), sender):
                after = replace(state, chain=mix(state.chain, chain))
                return after, (Send(Reply(mix(chain, state.step)), sender),)
        return state, (Ignored("unexpected"),)


class Talker:
    kinds = frozenset({"reply", "feedback"})

    def __init__(self, *, name: str, number: int) -> None:
        self.name, self.number = name, number

    def begin(self) -> Toy:
        return Toy(chain=self.number)

    def handle(self, state: Toy, event: Event) -> tuple[Toy, tuple[Effect, ...]]:
        match event:
            case Started(now):
                return state, (SetTimer("ask", now + 100_000_000),)
            case Timer():
                return state, (Send(Request(state.chain), "hub"),)
            case Received(_, Reply(chain), _):
                return replace(state, chain=mix(state.chain, chain)), ()
            case Received(now, Feedback(step, chain), _):
                state = Toy(mix(state.chain, chain), step)
                return state, (_told(self.name, state), SetTimer("ask", now + (state.chain % 5) * 20_000_000))
        return state, (Ignored("unexpected"),)


def party(talkers: int, *, steps: int, link: dict[str, object], seed: int = 1, speed: float = 1.0):
    """A hub and its talkers in a row, 10 m apart, ready to run."""
    run = RunSpec(f"toys-{seed}", seed, (steps + 1) * NS, link, speed)
    names = [f"t{i:02}" for i in range(talkers)]
    processes = [
        ProcessSpec("hub", "hub", "tests.toys:Hub", sink=True),
        *(
            ProcessSpec(n, "talker", "tests.toys:Talker", {"name": n, "number": i}, 10.0 * (i + 1), cells=("c0",))
            for i, n in enumerate(names)
        ),
    ]
    hub, *others = processes
    return run, [replace(hub, peers=places_of(others)), *(replace(p, peers=places_of([hub])) for p in others)]
