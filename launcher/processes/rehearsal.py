"""What a zygote does for its children before it forks them: all that a sensor node does, once.

Python writes to functions, types and caches when they are used for the first time. What was written before the fork is
shared, and no child has to write it again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict
from types import SimpleNamespace
from typing import Any, Final, Self

import msgpack
import zenoh
from zenoh.handlers import Callback

from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.joining.ask import subject
from trackfield.drivers.process import Process
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.link.energy import DEVICES
from trackfield.role import NS
from trackfield.sensing.kinds import known_sensor
from trackfield.wire import keys
from trackfield.wire.codec import encode
from trackfield.wire.envelope import Envelope
from trackfield.wire.messages import Threshold
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene

_NODE, _CENTRE = "n001", "fusion"
_PLACE: Final = {"name": _NODE, "live": True}
"""What else a process is told that starts elsewhere."""
_SECONDS: Final = 4
_RUN: Final = RunSpec("rehearsal", 1, _SECONDS * NS, {"model": "lognormal_prr"})


class _Stage:
    """A session in which the launcher answers every question, and then says stop, and the centre sets a threshold."""

    def __init__(self, seal: Seal) -> None:
        self._seal = seal
        self.put_keys: list[str] = []

    def get(self, key: str, handler: Callback[Any], *, payload: bytes, **options: object) -> None:
        """As ``zenoh.Session.get``."""
        told = msgpack.packb(
            {"run": asdict(_RUN), "process": _spec().plain(), "start_ns": 1, "stored": None, "ticket": "t", **_PLACE}
        )
        stamp = self._seal.stamp(subject(key, payload), told)
        handler.callback(SimpleNamespace(ok=_sample(key, told, stamp)))
        if handler.drop:
            handler.drop()

    def declare_subscriber(self, key: str, handler: Callback[Any]) -> None:
        """As ``zenoh.Session.declare_subscriber``; what it hears comes at once."""
        if key.startswith("data/"):
            at = keys.unicast("field", _NODE, _CENTRE, "threshold")
            handler.callback(_sample(at, encode(Threshold(1, 50.0)), Envelope(NS, version=0).pack()))
        else:
            handler.callback(_sample(keys.STOP, b"", self._seal.stamp(keys.STOP, b"")))

    def put(self, key: str, payload: bytes, **options: object) -> None:
        """As ``zenoh.Session.put``."""
        self.put_keys.append(key)

    def liveliness(self) -> Self:
        """As ``zenoh.Session.liveliness``."""
        return self

    def declare_token(self, key: str) -> None:
        """As ``zenoh.Liveliness.declare_token``."""

    def close(self) -> None:
        """As ``zenoh.Session.close``."""


def _sample(key: str, payload: bytes, stamp: bytes | None) -> Any:
    """What comes on a key."""
    return SimpleNamespace(key_expr=key, payload=zenoh.ZBytes(payload), attachment=zenoh.ZBytes(stamp or b""))


def a_node(join: Callable[[Any, str, str, Seal], Process] = Process) -> int:
    """Be a node that joins, hears a target pass by, and leaves; how many reports it sent.

    ``join`` makes it from a session, its name, its factory and the seal.
    """
    token = _CENTRE.encode()
    stage: Any = _Stage(Seal(token))
    join(stage, _NODE, _spec().factory, Seal(token)).run()
    return sum(key.startswith("data/") for key in stage.put_keys)


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
