"""Whole fields with a camera in virtual time, and what the processes beyond the gateway tell there."""

from __future__ import annotations

from functools import cache
from json import dumps, loads
from typing import Any, Final, NamedTuple

from launcher.plan.forecast.hearing.camera import Watched
from launcher.plan.forecast.hearing.passed import Passed
from launcher.plan.prepare import planned
from launcher.record.ledger import Ledger
from launcher.records import Passing, Plan
from tests.simulated import simulated
from trackfield.drivers.engine.frames import Told
from trackfield.models.pointing import Direction, Motion, in_view
from trackfield.role import NS, Tell
from trackfield.scenario import Scenario

NOISE: Final[dict[str, Any]] = {"sensor.waveform": False, "fusion.trackers": ["ml"]}
"""Passes by the noise model, which is much faster than in sound; one tracker."""
HOPS: Final[dict[str, Any]] = {
    "camera.hops": [[60, -60], [100, -60], [70, -40]],
    "backbone.model": "lognormal_prr",
    "backbone.radio": "wifi11b",
    "backbone.extra_loss": 0.1,
}
"""Three more hops by radio, as in the head comment of the packaged file."""


class Said(NamedTuple):
    """What a process told: when (s after the first step), who, and the values."""

    at_s: float
    id: str
    values: tuple[Any, ...]


class Watching(NamedTuple):
    """A run of a field with a camera."""

    plan: Plan
    ledger: Ledger

    def told(self, topic: str) -> list[Said]:
        """All of a topic, in the order of their instants."""
        found = [
            (one.key[0], diary.spec.id, one.effect.values)
            for diary in self.ledger.diaries.values()
            for one in diary.told
            if isinstance(one, Told) and isinstance(one.effect, Tell) and one.effect.topic == topic
        ]
        return [Said((at - self.plan.origin_ns) / NS, id, values) for at, id, values in sorted(found)]

    @property
    def outcomes(self) -> list[str]:
        """What became of each fix that camera control looked at."""
        return [str(said.values[-1]) for said in self.told("aimed")]

    @property
    def gateway(self) -> tuple[int, ...]:
        """What waits in the gateway at the end; then what passed, was refused, dropped, and unwanted."""
        return tuple(self.told("gateway")[-1].values)

    def look(self, at_s: float) -> Direction:
        """Where the camera really looks, so long after the first step."""
        began_s, _, values = max(said for said in self.told("motion") if said.at_s <= at_s)
        pan, tilt, to_pan, to_tilt, pan_s, tilt_s = values
        return Motion(Direction(pan, tilt), Direction(to_pan, to_tilt), pan_s, tilt_s).at(at_s - began_s)

    def sees(self, at_s: float) -> bool:
        """Whether a target is in the picture then."""
        states = (path.at(at_s + self.plan.origin_ns / NS) for path in self.plan.paths.values())
        mount, look = expected(self.plan).mount, self.look(at_s)
        return any(state is not None and in_view(mount, look, state[0], state[1]) for state in states)

    def frames(self) -> dict[int, int]:
        """How many frames each shot has."""
        found: dict[int, int] = {}
        for said in self.told("exposed"):
            found[said.values[0]] = found.get(said.values[0], 0) + 1
        return found


def watched(**changes: Any) -> Watching:
    """A run of the packaged field with these changes, ``a__b`` for the key ``a.b``."""
    return _watched(dumps({**NOISE, **{key.replace("__", "."): value for key, value in changes.items()}}))


@cache
def _watched(changes: str) -> Watching:
    plan = planned(Scenario.load("yang-ecpa", loads(changes)))
    ledger, _ = simulated(plan)
    assert isinstance(ledger, Ledger)
    return Watching(plan, ledger)


def expected(plan: Plan) -> Watched:
    """What is expected of the camera of a plan."""
    assert isinstance(plan.schedule, Passing)
    found = Watched.of(Passed.of(plan, plan.schedule))
    assert found is not None
    return found
