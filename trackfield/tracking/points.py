"""Estimates in published form: the points of a track."""

from __future__ import annotations

from dataclasses import replace
from typing import Final, Literal

import numpy as np

from trackfield.filters.measurement import STATE
from trackfield.filters.types import Estimate, Reports
from trackfield.role import TrackPoint

MAX_PARTICLES: Final = 200
"""How many particles of a tracker are published, at most."""


def track_point(
    tracker: str, target: str, at_ns: int, reports: Reports, estimate: Estimate | None, lag: int = 0
) -> TrackPoint:
    """The point of the step of these ``reports``, at ``at_ns``; without an estimate its status is ``waiting``."""
    step, sensors = reports.step, reports.sensors
    if estimate is None:
        return TrackPoint(tracker, target, at_ns, "waiting", sensors=sensors, lag=lag, step=step)
    status: Literal["tracking", "coasting"] = "tracking" if len(reports) else "coasting"
    particles = b""
    if estimate.particles is not None:
        thin = estimate.particles[:: -(-len(estimate.particles) // MAX_PARTICLES)]
        particles = thin.astype("<f4").tobytes()
    mean, covariance = estimate.mean[:STATE].tolist(), estimate.covariance[:STATE, :STATE].ravel().tolist()
    point = TrackPoint(tracker, target, at_ns, status, tuple(mean), tuple(covariance), sensors, particles, lag, step)
    if len(estimate.mean) == STATE:
        return point
    sds = np.sqrt(np.maximum(estimate.covariance.diagonal()[STATE:], 0.0))
    return replace(point, unknowns=tuple(estimate.mean[STATE:].tolist()), unknown_sds=tuple(sds.tolist()))
