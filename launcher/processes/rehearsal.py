"""What a zygote does for its children before it forks them: all that a sensor node does, once.

Python writes to functions, types and caches when they are used for the first time. What was written before the fork is
shared, and no child has to write it again.
"""

from __future__ import annotations

from dataclasses import asdict
from types import SimpleNamespace
from typing import Any, Final

import msgpack
import zenoh
from zenoh.handlers import Callback

from trackfield.drivers.ask import subject
from trackfield.drivers.frames import Sent, Told
from trackfield.drivers.intake import Refusals
from trackfield.drivers.join import join, token
from trackfield.drivers.seal import Seal
from trackfield.drivers.spec import ProcessSpec, RunSpec, build_core, link_of
from trackfield.drivers.telemetry import pack
from trackfield.link.energy import DEVICES
from trackfield.role import NS
from trackfield.sensing.kinds import known_sensor
from trackfield.wire import keys
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene

_NODE, _CENTRE = "n001", "fusion"
_SECONDS: Final = 4
_RUN: Final = RunSpec("rehearsal", 1, _SECONDS * NS, {"model": "lognormal_prr"})


class _Launcher:
    """A session in which the launcher answers every question: that there is a place for the node."""

    def __init__(self, seal: Seal) -> None:
        self._seal = seal

    def get(self, key: str, handler: Callback[Any], *, payload: bytes, **options: object) -> None:
        """As ``zenoh.Session.get``."""
        told = msgpack.packb(
            {"run": asdict(_RUN), "process": _spec().plain(), "start_ns": None, "stored": None, "ticket": "t"}
        )
        stamp = self._seal.stamp(subject(key, payload), told)
        sample = SimpleNamespace(payload=zenoh.ZBytes(told), attachment=zenoh.ZBytes(stamp or b""))
        handler.callback(SimpleNamespace(ok=sample))
        if handler.drop:
            handler.drop()


def a_node() -> int:
    """Be a node that joins and hears a target pass by; how many reports it sent."""
    seal = Seal(_CENTRE.encode())
    stage: Any = _Launcher(Seal(seal.token))
    joined = join(stage, _NODE, _spec().factory, seal, Refusals())
    token(_NODE, joined.ticket, seal)
    run, spec = joined.run, joined.process
    core = build_core(run, spec, link_of(run, spec.places), horizon_ns=NS)
    reports = []
    while (due := core.next_key()) is not None and due[0] < run.end_ns:
        for output in core.handle_next():
            if isinstance(output, Sent):
                reports.append(keys.unicast("field", _CENTRE, _NODE, output.frame.kind))
            elif isinstance(output, Told):
                seal.stamp(keys.telemetry(_NODE, "event"), pack(output))
    return len(reports)


def _spec() -> ProcessSpec:
    """What such a node is."""
    passing = Path.of([(0.0, 0.0, 0.0, 1.0, 0.0), (float(_SECONDS), float(_SECONDS), 0.0, 1.0, 0.0)])
    options = {"threshold": 50.0 / 70.0}
    kind = known_sensor("doa", options)
    sensor = Placed(_NODE, (0.0, 1.0), Scene((passing,)), ((0, _SECONDS * NS),), kind, options, kind.threshold, 1)
    return ProcessSpec(
        _NODE,
        "node",
        "node.role:Node",
        {"step_ns": NS, "centre": _CENTRE, "threshold_db": 50.0},
        sound=sensor.to_plain(),
        peers={_CENTRE: (5.0, 5.0)},
        power=asdict(DEVICES["cc2420"]),
    )
