"""What follows from closed forms and counts alone, beside what the paper says of it."""

from __future__ import annotations

from typing import Final

import numpy as np

from launcher.reproduce.intervals import Interval
from launcher.reproduce.kernels.scores import mean
from launcher.reproduce.kernels.study import Found
from launcher.reproduce.papers.yang.scores import share_of
from launcher.reproduce.papers.yang.solved.messages import sent
from launcher.reproduce.papers.yang.trials.sensitivity import (
    PAPER,
    C,
    angle_error,
    angle_error_of_places,
    angle_error_of_times,
    crossing_error,
    distance_error,
    proximity_bound,
    whole_degrees,
)
from launcher.reproduce.papers.yang.trials.triggered import NODES, RANGE_M, SIDE_M
from launcher.reproduce.tables import Row

TRIGGERED: Final = "triggered"
ROUNDED: Final = 0.02
"""A figure that the paper rounds to two or three digits is the same if it is off by no more than this share of it."""


def checks() -> list[tuple[str, str, float, float]]:
    """Equation, what is computed by it and its unit, our figure, the paper's."""
    alpha, phi = whole_degrees()
    mach, half_turn = PAPER.speed / C, np.radians(np.linspace(-90.0, 90.0, 180_001))
    of_place = np.abs(distance_error(PAPER.place_m, np.array(0.0), half_turn, mach))
    of_time = abs(float(distance_error(0.0, np.array(PAPER.time_s), np.array(0.0), mach)))
    field = np.degrees(abs(float(angle_error(np.radians(120.0), np.radians(87.0)))))
    apart = np.array(20.0)
    return [
        ("22", "error of r by a time off by 0.1 s, m", of_time, 17.0),
        ("22", "largest error of r by a place off by 2 m, m", float(of_place.max()), 34.0),
        ("24", "error of phi at alpha 120, phi 87 deg, deg", field, 0.068),
        ("26", "mean error of phi by times, rad", float(angle_error_of_times(alpha, phi).mean()), 0.112),
        ("27", "mean error of phi by places, rad", float(angle_error_of_places(alpha, phi).mean()), 0.202),
        ("37", "bound on r_1, strengths off by 50 %, m", float(crossing_error(apart, np.array(0.5))), 6.0),
        ("37", "bound on r_1, strengths off by 20 %, m", float(crossing_error(apart, np.array(0.2))), 3.0),
        ("1 / (rho R)", "error of proximity sensors, m", proximity_bound(NODES, SIDE_M**2, RANGE_M), 20.0),
    ]


def check_rows() -> list[Row]:
    """A row for each of ``checks``."""
    return [
        Row(f"eq. {equation}" if equation.isdigit() else equation, "-", what, exact(ours), published)
        for equation, what, ours, published in checks()
    ]


def agree(ours: float, published: float) -> bool:
    """Whether a figure is the paper's, but for rounding."""
    return abs(ours - published) <= ROUNDED * published


def exact(value: float) -> Interval:
    """A figure without an error."""
    return Interval(value, value, value)


def triggered_rows(found: Found) -> list[Row]:
    """Nodes that a target triggers in 5 s."""
    some = found.figures[TRIGGERED]
    return [
        Row(TRIGGERED, "-", "nodes that the target passes", mean(some["passed"]), 6.0),
        Row(TRIGGERED, "-", "nodes that it is ever in range of", mean(some["heard"])),
        Row(TRIGGERED, "-", "share of runs with passed nodes on both sides", share_of(some["crossed"])),
    ]


def message_rows() -> list[Row]:
    """Payload (bytes) of a pass of five nodes, for every way to locate a target."""
    return [Row(name, "-", "payload of a pass, bytes", exact(one.total)) for name, one in sent().items()]
