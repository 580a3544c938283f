"""The roles of ``toys`` in hard times: they keep what they know for their next life, and switch their radios off."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from tests.toys import Hub, Talker, Toy, party
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.role import NS, Effect, Event, Radio, Received, SetTimer, Started, Store, Timer

MS = 1_000_000


def kept(toy: Toy) -> Store:
    return Store(f"{toy.chain} {toy.step}".encode())


def known(event: Started) -> Toy:
    """What an earlier life knew; a new toy if there was none."""
    return Toy(*map(int, event.stored.split())) if event.stored else Toy()


class Keeper(Hub):
    """A hub whose next life goes on where this one was in its last step."""

    def handle(self, state: Toy, event: Event) -> tuple[Toy, tuple[Effect, ...]]:
        if isinstance(event, Started):
            return known(event), (SetTimer("step", (event.now // self.step_ns + 1) * self.step_ns),)
        state, effects = super().handle(state, event)
        return state, (*effects, kept(state)) if isinstance(event, Timer) else effects


class Napper(Talker):
    """A talker that sleeps for a while after each answer, for as long as that tells it, and misses what comes then."""

    def handle(self, state: Toy, event: Event) -> tuple[Toy, tuple[Effect, ...]]:
        match event:
            case Started(now):
                state = known(event) if event.stored else state
                return state, (SetTimer("ask", now + 1800 * MS),)  # by then it knows what is under way
            case Timer(_, "wake"):
                return state, (Radio(True),)
        after, effects = super().handle(state, event)
        if isinstance(event, Received) and after.chain != state.chain and not effects:
            nap = SetTimer("wake", event.now + after.chain % 10 * 130 * MS)
            return after, (*effects, Radio(False), nap, kept(after))
        return after, effects


def hard_times(*, link: dict[str, Any], speed: float = 1.0) -> tuple[RunSpec, list[ProcessSpec]]:
    """A hub and ten nodes for 20 s, each of whom something befalls; clocks are off, and batteries small."""
    run, (hub, *talkers) = party(10, steps=19, link=link, speed=speed)
    power = {"send_uw": 58_200, "receive_uw": 62_400, "listen_uw": 62_400, "sleep_uw": 7_400}
    nodes = [
        replace(
            node,
            role="node",
            factory="tests.mortals:Napper",
            clock={"offset_ns": (i - 5) * 7 * MS, "drift_ppb": (i - 5) * 20_000, "ramp_ppb_per_h": 10**5 * (i % 2)},
            power={**power, "battery_fj": (400 + 100 * i) * 10**12},
        )
        for i, node in enumerate(talkers)
    ]
    nodes[1] = replace(nodes[1], freezes=((3 * NS, 5 * NS + 300 * MS), (9 * NS, 9 * NS + 1)))
    nodes[2] = replace(nodes[2], jumps=((4 * NS, 500 * MS), (9 * NS, -2 * NS)))
    nodes[3] = replace(nodes[3], kill_ns=7 * NS + 123)
    lives = [
        *lived(replace(nodes[4], jumps=((2 * NS, 250 * MS),)), (0, 4 * NS), (6 * NS, 11 * NS), (11 * NS, None)),
        *lived(replace(hub, factory="tests.mortals:Keeper"), (0, 12 * NS + 500 * MS), (15 * NS, None)),
    ]
    partitions = ((8 * NS, 10 * NS, ("t05", "t06"), None), (9 * NS, 11 * NS, ("t06", "t07"), None))
    return replace(run, partitions=partitions), [*nodes[:4], *nodes[5:], *lives]


def lived(process: ProcessSpec, *spans: tuple[int, int | None]) -> list[ProcessSpec]:
    """The process in each of these lives (from ns, until ns)."""
    return [replace(process, incarnation=i, start_ns=start, kill_ns=kill) for i, (start, kill) in enumerate(spans)]
