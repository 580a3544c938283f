"""Two centres that each fuse half of the sensors' reports, and a base that publishes the better of their tracks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

from launcher.records import TRACKS, Place, Plan, View
from tests.simulated import spcpf
from trackfield.drivers.spec import ProcessSpec, places_of
from trackfield.role import NS, Effect, Event, Ignored, Publish, Received
from trackfield.tracking.forwarding import Gathered, Gathering, Numbering
from trackfield.tracking.threshold import position_sd
from trackfield.wire import Track

CENTRES: Final = ("fusion", "second")
BASE: Final = "base"


class Chooser:
    """Publishes of each instant the track with the smallest sd that came so far; knows nothing but these messages."""

    kinds = frozenset({"track"})

    def __init__(self, **both: Any) -> None:
        self.gathering = Gathering(Numbering(**both), 10 * NS)

    def begin(self) -> Gathered:
        return self.gathering.begin()

    def handle(self, state: Gathered, event: Event) -> tuple[Gathered, tuple[Effect, ...]]:
        match event:
            case Received(now, Track() as message, sender):
                state, points = self.gathering.take(state, now, message, sender)
                if isinstance(points, Ignored):
                    return state, (points,)
                return state, (Publish(min(points, key=position_sd)),)
        return state, ()


def two_centres(seed: int = 1, settings: Sequence[str] = (), **second: Any) -> Plan:
    """The plan of ``spcpf`` with every other node reporting to a second centre; ``second`` are changes to that one."""
    plan = spcpf(seed, settings)
    nodes = [one for one in plan.processes if one.role == "node"]
    lives = [one for one in plan.processes if one.role == "fusion"]
    halves = (nodes[::2], nodes[1::2])
    sensors = [node.id for node in nodes]
    forward = {"to": BASE, "sensors": sensors}
    centre = lives[0]
    place = {BASE: (centre.x + 30.0, centre.y)}
    centres = [
        replace(one, config={**one.config, "forward": forward}, peers=places_of(halves[0]) | place) for one in lives
    ]
    centre = centres[0]
    other = replace(
        centre,
        id=CENTRES[1],
        config={**centre.config, "draws": [CENTRES[1]]},
        y=centre.y - 50.0,
        peers=places_of(halves[1]) | place,
        **{"kill_ns": None, **second},
    )
    both = {
        "trackers": plan.tracking["trackers"],
        "sensors": sensors,
        "step_ns": plan.step_ns,
        "origin_ns": plan.origin_ns,
    }
    base = ProcessSpec(BASE, "base", "tests.two_centres:Chooser", both, *place[BASE], peers=places_of((centre, other)))
    told = [replace(node, config={**node.config, "centre": CENTRES[i % 2]}) for i, node in enumerate(nodes)]
    places = [Place(one.id, one.role, one.x, one.y, frozenset({TRACKS})) for one in (other, base)]
    info = replace(plan.info, places=(plan.info.places[0], *places, *plan.info.places[1:]))
    views = (View("base", (BASE,)), View("in-network", CENTRES))
    banks = {CENTRES[0]: {}, CENTRES[1]: {"draws": [CENTRES[1]]}}
    return replace(plan, processes=(*centres, other, base, *told), info=info, views=views, banks=banks)
