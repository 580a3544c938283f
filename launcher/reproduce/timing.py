"""The processor time of trackers: of their steps, on the reports of the same run, in one process."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from launcher.plan.prepare import planned
from launcher.record.ledger import Ledger
from launcher.records import Plan
from launcher.reproduce.case import Case
from trackfield.drivers.engine.frames import Frame
from trackfield.drivers.virtual import Virtual
from trackfield.filters.rng import generator
from trackfield.filters.trackers import make_tracker
from trackfield.filters.types import Gaussian, Model, Reports, Tracker, of_bearings
from trackfield.role import NS
from trackfield.sensing.kinds import make_sensor
from trackfield.wire.codec import decode
from trackfield.wire.messages import Doa

REPEATS: Final = 7
"""Repetitions; the least time is the figure, as other work of the machine only adds to it."""


class _Ear(Ledger):
    """Keeps the bearings that are sent."""

    def __init__(self, plan: Plan) -> None:
        super().__init__(plan.run, plan.processes)
        self.heard: list[tuple[str, Doa]] = []

    def sent(self, frame: Frame, version: int | None = 0) -> None:
        """A frame left."""
        super().sent(frame, version)
        message = decode(frame.payload)
        if isinstance(message, Doa):
            self.heard.append((frame.src, message))


@dataclass(frozen=True)
class Heard:
    """The input of the trackers of a run: the configuration of the centre, and the reports of each step."""

    config: Mapping[str, Any]
    reports: tuple[Reports, ...]

    def begun(self, tracker: Tracker[Any]) -> Any:
        """The tracker's state before the first step."""
        kinds = {name: make_sensor(**arguments) for name, arguments in self.config["sensing"].items()}
        prior, model = self.config["prior"], Model(kinds, self.config["sigma_v"])
        return tracker.init(Gaussian(np.array(prior["mean"]), np.diag(np.square(prior["sd"]))), model)

    def stepped(self, tracker: Tracker[Any], state: Any, some: Reports, rng: np.random.Generator) -> Any:
        """The state and the estimate after these reports."""
        return tracker.step(state, some, self.config["step_ns"] / NS, rng)

    def rng(self, name: str, some: Reports) -> np.random.Generator:
        """The random generator of the tracker of this name in this step."""
        return generator(self.config["seed"], name, some.step)


def heard(case: Case, seed: int) -> Heard:
    """The input from a run whose link loses nothing."""
    plan = planned(case.scenario(seed))
    ear = _Ear(plan)
    Virtual(plan.run, plan.processes, ear).run()
    config = plan.tracking
    return Heard(config, tuple(_reports(config, ear.heard, plan.run.end_ns // plan.step_ns - 1)))


def cpu_times(case: Case, seed: int = 1) -> dict[str, list[float]]:
    """Processor time (s) of all steps of a run by tracker, for each repetition; all take turns on the same reports."""
    given = heard(case, seed)
    trackers = {name: make_tracker(name, options) for name, options in case.trackers.items()}
    times: dict[str, list[float]] = {name: [] for name in trackers}
    for _ in range(REPEATS):
        for name, tracker in trackers.items():
            times[name].append(_cpu_s(given, name, tracker))
    return times


def _cpu_s(given: Heard, name: str, tracker: Tracker[Any]) -> float:
    state, spent = given.begun(tracker), 0.0
    for some in given.reports:
        rng = given.rng(name, some)
        begun = time.process_time()
        state, _ = given.stepped(tracker, state, some, rng)
        spent += time.process_time() - begun
    return spent


def _reports(config: Mapping[str, Any], told: Iterable[tuple[str, Doa]], steps: int) -> list[Reports]:
    """The reports of each step at the fusion centre if no message is lost."""
    places = {id: (x, y) for id, x, y in config["sensors"]}
    by_step: dict[int, dict[str, Doa]] = {step: {} for step in range(1, steps + 1)}
    for sensor, message in told:
        if message.step in by_step:
            by_step[message.step][sensor] = message
    return [
        of_bearings(
            step,
            tuple(sorted(some)),
            np.array([places[id] for id in sorted(some)], float).reshape(-1, 2),
            np.radians([some[id].bearing_deg for id in sorted(some)]),
            np.array([some[id].level_db for id in sorted(some)], float),
        )
        for step, some in by_step.items()
    ]
