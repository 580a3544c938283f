"""Small fields with the architecture ``cpa``, and what is expected of them."""

from __future__ import annotations

from typing import Any, Final

from launcher.plan.forecast.hearing.passed import Passed
from launcher.plan.prepare import planned
from launcher.records import Passing, Plan
from trackfield.scenario import Scenario

SMALL: Final[dict[str, Any]] = {
    "name": "small",
    "field": {"layout": "pentagon", "centres": [[0, 0]]},
    "sensor": {"kind": "cpa", "range_m": 50.0, "time_sd_s": 0.01},
    "target": {
        "path": "waypoints", "waypoints": [[0, -134, -7], [20, 134, 7], [40, -134, -7]], "step_s": 0.5, "steps": 80,
    },
    "link": {"model": "fixed", "delay_ms": 10.0, "loss": 0.0, "range_m": 30.0},
    "architecture": {"kind": "cpa"},
    "fusion": {"trackers": ["ml"], "deadline_s": 0.4, "x_m": 30.0, "y_m": -25.0, "max_age_s": 2.0},
    "clock": {"offset_ms": 20.0, "drift_ppm": 20.0},
}  # fmt: skip
"""A cluster that is passed twice. Sides of the pentagon hop, diagonals do not; the base hears one node."""
THREE: Final[dict[str, Any]] = {
    **SMALL,
    "field": {"layout": "pentagon", "centres": [[0, 0], [60, 3], [120, -2]]},
    "target": {
        "path": "waypoints", "waypoints": [[0, -134, -7], [30, 268, 7]], "step_s": 0.5, "steps": 60,
    },
    "link": {"model": "fixed", "delay_ms": 10.0, "loss": 0.0, "range_m": 45.0},
}  # fmt: skip
"""Three clusters along a road, near enough for a radio."""
RANDOM: Final[dict[str, Any]] = {
    **SMALL,
    "field": {"layout": "random", "nodes": 25, "spacing_m": 20.0},
    "sensor": {"kind": "cpa", "range_m": 20.0, "time_sd_s": 0.01},
    "target": {"path": "waypoints", "waypoints": [[0, -40, 30], [14, 140, 70]], "step_s": 0.5, "steps": 28},
    "link": {"model": "fixed", "delay_ms": 10.0, "loss": 0.0, "range_m": 40.0},
    "architecture": {"kind": "cpa", "heads": "loudest"},
    "fusion": {**SMALL["fusion"], "x_m": 50.0, "y_m": 50.0},
}
"""25 sensors anywhere on 100 x 100 m that hear 20 m; the loudest leads."""


def plan_of(scenario: dict[str, Any] = SMALL, **changes: Any) -> Plan:
    """The plan of a field with some changes, ``a__b`` for the key ``a.b``."""
    return planned(Scenario.load(scenario, {key.replace("__", "."): value for key, value in changes.items()}))


def expected(plan: Plan) -> Passed:
    """What is expected of a plan."""
    assert isinstance(plan.schedule, Passing)
    return Passed.of(plan, plan.schedule)
