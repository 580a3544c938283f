"""What clusters along the track of the packaged bus make of it: ``python -m tests.hearing_bus`` prints their events.

A recorded track is not what solvers assume. The bus speeds up or brakes by 1 m/s^2 nearly all the time: a second from
the middle of a cluster it is half a metre from where it would be at constant speed, at 10 m/s 50 ms. The detector's
times of passes at 8 m have a standard deviation of 11 ms: trackers take them to be four times less precise.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

import numpy as np

from launcher.plan.prepare import load, planned
from launcher.record.figures.passes.ended import Ended, ended
from launcher.record.figures.passes.found import Errors, Truth
from launcher.record.figures.passes.metrics import base_of
from launcher.records import Plan
from tests.simulated import simulated
from trackfield.role import NS

SETTINGS: Final = (
    "camera.kind=none",
    "field={layout='pentagon', corner_m=10}",
    "target={path='file', file='bus.gpx', step_s=0.5}",
    "sensor.waveform=false",
    "fusion.assumed_noise=4",
    "fusion.trackers=['ml']",
)
AROUND_S: Final = 2.0
"""The path is looked at from so long before an event until as long after it."""
STANDS_M_S: Final = 0.5
TURNS_DEG: Final = 15.0


class Found(NamedTuple):
    """How an event ended at its head: ``at_s``, emulated time since the start of the track.

    Of the bus: its least and highest speed around then, and by how much it turned. Of a fix: how far it is off, with
    the bus nearest to the middle of the sensors, in m, m/s and degrees, and the standard deviation of its place, m.
    """

    at_s: float
    head: str
    reports: int
    slowest_m_s: float
    fastest_m_s: float
    turned_deg: float
    refused: str
    errors: Errors | None
    sd_m: float | None

    @property
    def bus(self) -> str:
        """What it does, in words."""
        if self.slowest_m_s < STANDS_M_S:
            return "stops or stands"
        return "turns" if self.turned_deg > TURNS_DEG else "goes straight on"


def events(steps: int, range_m: float) -> list[Found]:
    """All of a run of so many steps with a radio of this range, in the order of their ends."""
    settings = [*SETTINGS, f"target.steps={steps}", f"link.range_m={range_m}"]
    plan = planned(load("yang-ecpa", settings=settings))
    _, rows = simulated(plan)
    truth = Truth(plan)
    return [_found(plan, truth, one) for one in ended(rows, base_of(plan))]


def _found(plan: Plan, truth: Truth, one: Ended) -> Found:
    (path,) = plan.paths.values()
    around = np.linspace(one.event_ns / NS - AROUND_S, one.event_ns / NS + AROUND_S, 41)
    velocities = np.array([state[2:] for t in around if (state := path.at(float(t))) is not None])
    speeds = np.hypot(*velocities.T)
    headings = np.unwrap(np.arctan2(*velocities[speeds > STANDS_M_S].T))
    fix = None if one.refused else truth.fix(one)
    return Found(
        (one.event_ns - plan.origin_ns) / NS,
        one.row.point.source,
        len(one.sensors),
        float(speeds.min()),
        float(speeds.max()),
        float(np.degrees(np.ptp(headings))) if len(headings) else 0.0,
        one.refused,
        fix and fix.errors,
        None if fix is None else float(np.sqrt(np.trace(np.reshape(one.row.point.covariance, (4, 4))[:2, :2]))),
    )


def table(found: Iterable[Found]) -> Iterator[str]:
    """A row for each event."""
    yield "| at | head | the bus | its speed within 2 s | reports | fix: place, speed, heading off by |"
    yield "| --- | --- | --- | --- | --- | --- |"
    for one in found:
        said = f"none: {one.refused}"
        if one.errors is not None:
            place_m, speed_m_s, heading_deg = one.errors
            said = f"{place_m:.2f} m, {speed_m_s:.2f} m/s, {heading_deg:.1f} degrees"
        speeds = f"{one.slowest_m_s:.1f} to {one.fastest_m_s:.1f} m/s"
        yield f"| {one.at_s:.0f} s | {one.head} | {one.bus} | {speeds} | {one.reports} | {said} |"


def main() -> None:
    """Print the table."""
    for line in table(events(210, 60.0)):
        print(line)


if __name__ == "__main__":
    main()
