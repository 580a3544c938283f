"""An election by broadcast: who hears no better claim within its back-off claims; the best claim is relayed.

A round a second. Each contender draws a merit and a back-off within 0.2 s. If it has heard of a better merit by then it
holds back, else it claims. Whoever hears a better claim than it knew relays it some milliseconds later, and so does one
that hears somebody claim with less than the best that it knows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Final

from tests.protocols.chains import MS, Chain, acquainted, kept, known, next_step, run_of, told
from tests.toys import mix
from trackfield.draw import bits
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.role import (
    NEIGHBOURHOOD,
    NS,
    CancelTimer,
    Effect,
    Event,
    Ignored,
    Radio,
    Received,
    Send,
    SetTimer,
    Started,
    Timer,
)
from trackfield.wire.registry import Scaled, kind

BACK_OFF_NS: Final = 200 * MS
MERITS: Final = 4096
LOSS: Final = 0.3


@kind(243, "bid")
@dataclass(frozen=True, slots=True)
class Claim:
    """The best candidate of a round that the sender knows; ``hops`` is 0 from the candidate itself."""

    round: Annotated[int, Scaled(0, 65535)]
    merit: Annotated[int, Scaled(0, MERITS - 1)]
    candidate: Annotated[int, Scaled(0, 255)]
    hops: Annotated[int, Scaled(0, 255)]
    chain: Chain


@dataclass(frozen=True)
class Ballot:
    """The best (merit, candidate) of this round so far, and how many hops away it is."""

    chain: int
    round: int = 0
    best: tuple[int, int] = (-1, 0)
    hops: int = 0


class Contender:
    """One of those who elect, and may be elected; with ``naps`` it sleeps through the end of each round."""

    kinds = frozenset({"bid"})

    def __init__(self, *, name: str, number: int, seed: int, naps: bool = False) -> None:
        self.name, self.number, self.seed, self.naps = name, number, seed, naps

    def begin(self) -> Ballot:
        return Ballot(self.number)

    def handle(self, state: Ballot, event: Event) -> tuple[Ballot, tuple[Effect, ...]]:
        match event:
            case Started(now):
                chain, round = known(event, state.chain, 0)
                return Ballot(chain, round), (next_step(now),)
            case Timer(now, "step"):
                chain = mix(state.chain, max(state.best[0], 0))
                after, effects = self._opened(replace(state, chain=chain), max(now // NS, state.round), now)
                wake = (Radio(True),) if self.naps else ()
                return after, (*wake, *effects, told(self.name, now, chain), kept(chain, after.round), next_step(now))
            case Timer(now, "claim"):
                own = self._merit(state.round), self.number
                return self._claimed(replace(state, best=own, hops=0)) if own > state.best else (state, ())
            case Timer(now, "relay"):
                return self._claimed(replace(state, hops=min(state.hops + 1, 255)))
            case Timer(now, "nap"):
                return state, (Radio(False),)
            case Received(now, Claim() as claim):
                return self._heard(replace(state, chain=mix(state.chain, claim.chain)), claim, now)
        return state, (Ignored("unexpected"),)

    def _merit(self, round: int) -> int:
        return bits(self.seed, "merit", self.number, round) % MERITS

    def _opened(self, state: Ballot, round: int, now: int) -> tuple[Ballot, tuple[Effect, ...]]:
        """A round begins, unless another's clock had begun it before."""
        if round == state.round and state.best[0] >= 0:
            return state, ()
        wait = bits(self.seed, "back-off", self.number, round, state.chain) % BACK_OFF_NS
        nap = (SetTimer("nap", now + (250 + state.chain % 200) * MS),) if self.naps else ()
        return Ballot(state.chain, round), (CancelTimer("relay"), SetTimer("claim", now + wait), *nap)

    def _heard(self, state: Ballot, claim: Claim, now: int) -> tuple[Ballot, tuple[Effect, ...]]:
        effects: tuple[Effect, ...] = ()
        if claim.round < state.round:
            return state, (Ignored("over"),)
        if claim.round > state.round:
            state, effects = self._opened(state, claim.round, now)
        relay = SetTimer("relay", now + (2 + state.chain % 9) * MS)
        if (claim.merit, claim.candidate) > state.best:
            return replace(state, best=(claim.merit, claim.candidate), hops=claim.hops), (*effects, relay)
        if (claim.merit, claim.candidate) < state.best and not claim.hops:
            return state, (*effects, relay)
        return state, effects

    @staticmethod
    def _claimed(state: Ballot) -> tuple[Ballot, tuple[Effect, ...]]:
        return state, (Send(Claim(state.round, *state.best, state.hops, state.chain), NEIGHBOURHOOD),)


def party(
    seed: int, *, speed: float = 1.0, size: int = 12, seconds: int = 10, naps: bool = False, loss: float = LOSS
) -> tuple[RunSpec, list[ProcessSpec]]:
    """Contenders who all hear each other, ready to run."""
    processes = [
        ProcessSpec(
            f"c{i:02}",
            "contender",
            "tests.protocols.election:Contender",
            {"name": f"c{i:02}", "number": i, "seed": seed, "naps": naps},
            x=10.0 * i,
            cells=("c0",),
        )
        for i in range(size)
    ]
    run = run_of("election", seed, seconds, loss, speed)
    return run, acquainted(processes)
