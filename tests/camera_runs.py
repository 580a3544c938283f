"""Whole fields with a camera, in virtual time: what camera control told, and what the camera saw at the aim times."""

from __future__ import annotations

from typing import Any, NamedTuple

from launcher.plan.prepare import load, planned
from launcher.record.ledger import Ledger
from launcher.records import Plan
from tests.simulated import simulated
from trackfield.models.pointing import Direction, Motion, Mount, in_view
from trackfield.role import NS, Tell

QUICK = ("sensor.waveform=false", "camera.kind=evi-d30")


class Aimed(NamedTuple):
    """The values of ``Tell("aimed")``, and when it was told (true time, ns)."""

    told_ns: int
    shot: int
    head: str
    step: int
    delay_s: float
    cpa_ns: int
    aim_ns: int
    x_m: float
    y_m: float
    pan: float
    tilt: float
    outcome: str


class Field(NamedTuple):
    """A run that is over."""

    plan: Plan
    ledger: Ledger

    def told(self, process: str, topic: str) -> list[tuple[int, tuple[Any, ...]]]:
        """What a process told of a topic, and when."""
        return [
            (one.key[0], one.effect.values)
            for diary in self.ledger.diaries.values()
            if diary.spec.id == process
            for one in diary.told
            if isinstance(one.effect, Tell) and one.effect.topic == topic
        ]

    @property
    def aimed(self) -> list[Aimed]:
        """What camera control told of fixes."""
        return [Aimed(at_ns, *values) for at_ns, values in self.told("camera-control", "aimed")]

    @property
    def mount(self) -> Mount:
        """How the camera stands."""
        control = next(one for one in self.plan.processes if one.id == "camera-control")
        return Mount(**control.config["mount"])

    def look(self, at_ns: int) -> Direction:
        """Where the camera looked."""
        began_ns, values = [one for one in self.told("camera", "motion") if one[0] <= at_ns][-1]
        pan0, tilt0, pan1, tilt1, pan_s, tilt_s = values
        return Motion(Direction(pan0, tilt0), Direction(pan1, tilt1), pan_s, tilt_s).at((at_ns - began_ns) / NS)

    def in_frame(self, at_ns: int, target: str = "target") -> bool:
        """Whether a target was in the picture."""
        state = self.plan.paths[target].at(at_ns / NS)
        return state is not None and in_view(self.mount, self.look(at_ns), float(state[0]), float(state[1]))


def run(*settings: str, seed: int = 1) -> Field:
    """``yang-ecpa`` with a camera, and these settings."""
    plan = planned(load("yang-ecpa", seed=seed, settings=(*QUICK, *settings)))
    ledger, _ = simulated(plan)
    return Field(plan, ledger)
