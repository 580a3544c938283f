"""What a zygote does for its children before it forks them: all that a sensor node does, once.

Python writes to functions, types and caches when they are used for the first time. What was written before the fork is
shared, and no child has to write it again.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Final

import msgpack

from trackfield.drivers.frames import Sent, Told
from trackfield.drivers.intake import read, unpacked
from trackfield.drivers.join import joined
from trackfield.drivers.seal import Seal
from trackfield.drivers.spec import ProcessSpec, RunSpec, build_core, link_of
from trackfield.drivers.telemetry import pack
from trackfield.link.energy import DEVICES
from trackfield.role import NS
from trackfield.wire import keys
from trackfield.world.acoustic import AcousticSensor
from trackfield.world.path import Path

_NODE, _CENTRE = "n001", "fusion"
_SECONDS: Final = 4
_RUN: Final = RunSpec("rehearsal", 1, _SECONDS * NS, {"model": "lognormal_prr"})


def a_node() -> int:
    """Be a node that hears a target pass by; how many reports it sent."""
    seal = Seal(_CENTRE.encode())
    run, spec = _joined(seal)
    core = build_core(run, spec, link_of(run, spec.places), horizon_ns=NS)
    reports = []
    while (due := core.next_key()) is not None and due[0] < run.end_ns:
        for output in core.handle_next():
            if isinstance(output, Sent):
                reports.append(keys.unicast("field", _CENTRE, _NODE, output.frame.kind))
            elif isinstance(output, Told):
                seal.stamp(keys.telemetry(_NODE, "event"), pack(output))
    return len(reports)


def _joined(seal: Seal) -> tuple[RunSpec, ProcessSpec]:
    """What such a node is told, as it comes from the launcher."""
    passing = Path.of([(0.0, 0.0, 0.0, 1.0, 0.0), (float(_SECONDS), float(_SECONDS), 0.0, 1.0, 0.0)])
    sensor = AcousticSensor(_NODE, (0.0, 1.0), (passing,), ((0, _SECONDS * NS),), 70.0, 2.0, 50.0, 3.0, 0.0, 1)
    spec = ProcessSpec(
        _NODE,
        "node",
        "node.role:Node",
        {"step_ns": NS, "centre": _CENTRE, "threshold_db": 50.0},
        sound=sensor.to_plain(),
        peers={_CENTRE: (5.0, 5.0)},
        power=asdict(DEVICES["cc2420"]),
    )
    answer = msgpack.packb(
        {"run": asdict(_RUN), "process": spec.plain(), "start_ns": None, "stored": None, "ticket": "t"}
    )
    seal.check(keys.JOIN, answer, seal.stamp(keys.JOIN, answer))
    seal.mark(keys.live(_NODE))
    told = read(joined, unpacked(answer), _NODE, spec.factory)
    return told.run, told.process
