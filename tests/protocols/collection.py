"""A tree over several hops: each process tells the base its chain, and the base answers each at once by the tree.

The processes stand in a field of which the base is a corner, and hear those nearby only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from tests.protocols.chains import MS, Chain, acquainted, kept, known, next_step, told
from tests.toys import mix
from trackfield.draw import uniform
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.role import NS, Effect, Event, Ignored, Received, Send, SetTimer, Started, Timer
from trackfield.wire.registry import kind

BASE: Final = "base"
RADIO: Final = {"model": "lognormal_prr", "radio": "802154-0dbm", "ack": 0}
SPACING_M: Final = 55.0
LOSS: Final = 0.05


@kind(238, "word")
@dataclass(frozen=True, slots=True)
class Word:
    """What a process tells the base."""

    chain: Chain


@kind(239, "echo")
@dataclass(frozen=True, slots=True)
class Echo:
    """What the base says to that."""

    chain: Chain


@dataclass(frozen=True)
class Mind:
    chain: int


class Speaker:
    """Tells the base its chain some times a second."""

    kinds = frozenset({"echo"})

    def __init__(self, *, name: str, number: int) -> None:
        self.name, self.number = name, number

    def begin(self) -> Mind:
        return Mind(self.number)

    def handle(self, state: Mind, event: Event) -> tuple[Mind, tuple[Effect, ...]]:
        match event:
            case Started(now):
                return Mind(*known(event, state.chain)), (next_step(now), self._speaks(state, now))
            case Timer(now, "step"):
                return state, (told(self.name, now, state.chain), kept(state.chain), next_step(now))
            case Timer(now, "speak"):
                return state, (Send(Word(state.chain), BASE), self._speaks(state, now))
            case Received(_, Echo(chain), sender) if sender == BASE:
                return Mind(mix(state.chain, chain)), ()
        return state, (Ignored("unexpected"),)

    def _speaks(self, state: Mind, now: int) -> SetTimer:
        return SetTimer("speak", now + int((300 + 200 * uniform(1, self.name, now, state.chain)) * MS))


class Listener:
    """The base: its chain is of all that it heard, in that order."""

    kinds = frozenset({"word"})

    def begin(self) -> Mind:
        return Mind(0)

    def handle(self, state: Mind, event: Event) -> tuple[Mind, tuple[Effect, ...]]:
        match event:
            case Started(now):
                return Mind(*known(event, state.chain)), (next_step(now),)
            case Timer(now):
                return state, (told(BASE, now, state.chain), kept(state.chain), next_step(now))
            case Received(_, Word(chain), sender):
                state = Mind(mix(mix(state.chain, chain), sum(sender.encode())))
                return state, (Send(Echo(state.chain), sender),)
        return state, (Ignored("unexpected"),)


def party(
    seed: int,
    *,
    speed: float = 1.0,
    size: int = 9,
    seconds: int = 10,
    loss: float = LOSS,
    spacing_m: float = SPACING_M,
) -> tuple[RunSpec, list[ProcessSpec]]:
    """A square field with the base in a corner, whose links are silent for a share ``loss`` of the time."""
    tree = {"base": BASE, "seed": seed}
    side = max(int((size - 1) ** 0.5), 1)
    places = [(spacing_m * (i % side + 1), spacing_m * (i // side)) for i in range(size - 1)]
    processes = [
        ProcessSpec(BASE, "listener", "tests.protocols.collection:Listener", sink=True, cells=("c0",), tree=tree),
        *(
            ProcessSpec(
                f"s{i}",
                "speaker",
                "tests.protocols.collection:Speaker",
                {"name": f"s{i}", "number": i},
                x=x,
                y=y,
                cells=("c0",),
                tree=tree,
            )
            for i, (x, y) in enumerate(places)
        ),
    ]
    link = {**RADIO, "burst_loss": loss, "burst_s": 0.5} if loss else RADIO
    run = RunSpec(f"collection-{seed}", seed, seconds * NS, link, speed)
    return run, acquainted(processes)
