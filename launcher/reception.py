"""How well a plan's radio carries what its processes say to each other."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from launcher.records import Plan
from trackfield.drivers.spec import ProcessSpec, places_of
from trackfield.link.models import make_link
from trackfield.wire.codec import encode
from trackfield.wire.messages import Doa, Measurement, SyncReply, SyncRequest, Threshold
from trackfield.wire.registry import kind_of
from trackfield.world.sensors import make_sensor

INSTANTS: Final = 50
"""At how many instants of a run the links of somebody who moves are looked at."""

Shares = dict[tuple[str, str], float]
"""By sender and hearer."""


def receptions(plan: Plan) -> dict[str, Shares]:
    """The share of its messages that each link in use may expect to carry, by kind of message, reports first.

    Of who moves, the mean over the run.
    """
    nodes = {p.id: p for p in plan.processes if p.role == "node"}
    now_us = plan.run.end_ns // 1000
    there: list[object] = [_report(nodes.values())]
    back: list[object] = []
    if any(p.config.get("sync") for p in nodes.values()):
        there.append(SyncRequest(65535, now_us))
        back.append(SyncReply(65535, now_us, now_us, now_us))
    if any(p.config.get("adaptive") for p in nodes.values()):
        back.append(Threshold(65535, 70.0))
    centre = next(p.id for p in plan.processes if p.role == "fusion")
    links = [(one, [(id, centre) for id in nodes]) for one in there] + [
        (one, [(centre, id) for id in nodes]) for one in back
    ]
    return {kind_of(one).name: _shares(plan, one, pairs) for one, pairs in links}


def _report(nodes: Iterable[ProcessSpec]) -> Doa | Measurement:
    """One as long as they are where they are long; of a user's sensor, with as many numbers."""
    sound = next(iter(nodes)).sound
    if "kind" not in sound:
        return Doa(step=65535, bearing_deg=359.99, level_db=70.0)
    sensor = make_sensor(sound["kind"], sound["options"], sound["place"])
    return Measurement(65535, (2**15 - 1,) * len(sensor.resolution))


def _shares(plan: Plan, message: object, pairs: list[tuple[str, str]]) -> Shares:
    link = make_link(plan.run.link, plan.run.seed, places_of(plan.processes))
    kind, size = kind_of(message).name, len(encode(message))
    moving = any(p.legs for p in plan.processes)
    times = [plan.run.end_ns * k // INSTANTS for k in range(INSTANTS)] if moving else [0]
    return {
        (src, dst): sum(link.reception(src, dst, size, kind, at) for at in times) / len(times) for src, dst in pairs
    }
