"""Trials of solvers: targets that pass the five sensors of Yang et al., and what these report of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from trackfield.filters.passes.cpa import angles
from trackfield.filters.passes.geometry import dot, right
from trackfield.filters.passes.strength import extent
from trackfield.filters.passes.types import Event, Passes
from trackfield.filters.types import Array

SOUND = 340.0
_ANGLES = np.radians(90.0 + 72.0 * np.arange(5))
_JITTER = np.array([[0.05, -0.08], [0.10, 0.05], [-0.08, 0.10], [0.06, -0.05], [-0.10, 0.02]])
PENTAGON = np.stack((np.cos(_ANGLES), np.sin(_ANGLES)), axis=-1) + _JITTER
"""(5, 2) the places of the sensors in a field of radius 1."""


class Trials(NamedTuple):
    """``truth`` (N, 4): x, y, vx, vy at time ``time_s`` (N,); ``true_places`` (N, 5, 2), and what is reported."""

    truth: Array
    time_s: Array
    true_places: Array
    passes: Passes


def angles_as_printed(difference: Array, delta: Array, mach: Array) -> Array:
    """``angles`` by eq. 19 as printed: (-xi + eta / M) cos phi + (-eta - xi / M) sin phi = delta."""
    return -angles(difference * [-1.0, 1.0], delta, mach)


def located_by_two(event: Event, e: Array) -> Array:
    """The offset (...,) by eq. 34 from the two weakest reports, as printed: ill-conditioned, often on the wrong side.

    Their distances are as 1 / s: the path is between them, or beyond the less far one. As in figure 6, no path is
    outside of the hull, and it is the one from which others are the least farther than these two.
    """
    weak = np.argsort(np.where(event.loud, event.logs, np.inf), axis=-1, kind="stable")[..., :2]
    aside = dot(event.at, right(e))
    q1, q2 = np.moveaxis(np.take_along_axis(aside, weak, axis=-1), -1, 0)
    s1, s2 = np.exp(np.moveaxis(np.take_along_axis(event.logs, weak, axis=-1), -1, 0))
    between = (s1 * q1 + s2 * q2) / (s1 + s2)
    beyond = (s2 * q2 - s1 * q1) / np.where(s2 == s1, np.nan, s2 - s1)
    paths = np.stack((between, beyond), axis=-1)
    low, high = (end[..., None] for end in extent(event, e))
    d = np.where(event.heard[..., None, :], np.abs(aside[..., None, :] - paths[..., None]), 0.0)
    nearer = np.minimum(np.abs(q1[..., None] - paths), np.abs(q2[..., None] - paths))
    excess = np.where((paths > low) & (paths < high), d.max(axis=-1) - nearer, np.inf)
    return np.take_along_axis(paths, excess.argmin(axis=-1)[..., None], axis=-1)[..., 0]


def paths(rng: np.random.Generator, number: int, places: Array, speed: float, least_m: float) -> Array:
    """(number, 4) lines that cross the hull of the sensors, uniform, and pass none at less than ``least_m``."""
    found: list[Array] = []
    while len(found) < number:
        heading = rng.uniform(0.0, 2.0 * np.pi)
        e = np.array([np.cos(heading), np.sin(heading)])
        n = np.array([e[1], -e[0]])
        aside = places @ n
        offset = rng.uniform(aside.min(), aside.max())
        if np.abs(aside - offset).min() >= least_m:
            along = places.mean(axis=0) @ e
            found.append(np.concatenate((offset * n + along * e, speed * e)))
    return np.array(found)


def trials(
    number: int,
    *,
    seed: int = 1,
    radius_m: float = 20.0,
    speed: float = 13.4,
    least_m: float = 2.0,
    time_sd: float = 0.1,
    strength_sd: float = 0.1,
    distance_power: float = 0.0,
    at_m: float = 12.0,
    speed_power: float = 0.0,
    place_error_m: float = 0.0,
    places: Array = PENTAGON,
) -> Trials:
    """Passes with noise: sd of time ``time_sd`` (max(d, 3) / at_m)^p (13.4 / v)^q.

    Sensors are off their assumed places by a distance that is uniform up to ``place_error_m``, in any direction.
    """
    rng = np.random.default_rng(seed)
    places = radius_m * places
    truth = paths(rng, number, places, speed, least_m)
    off = rng.uniform(0.0, place_error_m, (number, len(places)))
    way = rng.uniform(0.0, 2.0 * np.pi, (number, len(places)))
    true_places = places + off[..., None] * np.stack((np.cos(way), np.sin(way)), axis=-1)
    time_s = rng.uniform(100.0, 200.0, number)
    times, d = heard(truth, time_s, true_places)
    sd = time_sd * (np.maximum(d, 3.0) / at_m) ** distance_power * (13.4 / speed) ** speed_power
    times = times + sd * rng.standard_normal(d.shape)
    strengths = 1000.0 / np.maximum(d, 0.1) * np.maximum(1.0 + strength_sd * rng.standard_normal(d.shape), 0.05)
    passes = Passes(
        np.broadcast_to(places, true_places.shape),
        times,
        strengths,
        np.maximum(sd, 1e-4),
        np.full_like(times, max(strength_sd, 1e-3)),
        place_error_m / np.sqrt(6.0),
    )
    return Trials(truth, time_s, true_places, passes)


def heard(truth: Array, time_s: Array, places: Array, sound_m_s: float = SOUND) -> tuple[Array, Array]:
    """When sensors (N, K, 2) hear the targets loudest, and their distances then, (N, K)."""
    away = places - truth[:, None, :2]
    v = truth[:, None, 2:]
    square = np.square(v).sum(axis=-1)
    along = (away * v).sum(axis=-1) / square
    d = np.abs(v[..., 0] * away[..., 1] - v[..., 1] * away[..., 0]) / np.sqrt(square)
    return time_s[:, None] + along + d / sound_m_s, d


class Arcs(NamedTuple):
    """N targets on a circle about the origin, that pass E clusters: ``passes`` (N, E, K)."""

    radius_m: float
    speed: float
    passes: Passes

    def off(self, places: Array) -> Array:
        """How far places (..., 2) are from the path, m."""
        return np.abs(np.linalg.norm(places, axis=-1) - self.radius_m)


def arcs(
    number: int,
    clusters: int = 4,
    *,
    seed: int = 1,
    radius_m: float = 100.0,
    apart_m: float = 60.0,
    speed: float = 13.4,
) -> Arcs:
    """Clusters stand ``apart_m`` apart along the circle, off the path by up to 8 m, turned any way."""
    rng = np.random.default_rng(seed)
    at = apart_m * np.arange(clusters) / radius_m
    centre = (radius_m + rng.uniform(-8.0, 8.0, (number, clusters)))[..., None] * np.stack(
        (np.cos(at), np.sin(at)), axis=-1
    )
    turn = rng.uniform(0.0, 2.0 * np.pi, (number, clusters))
    cos, sin = np.cos(turn), np.sin(turn)
    turned = np.stack((np.stack((cos, -sin), axis=-1), np.stack((sin, cos), axis=-1)), axis=-2)
    places = centre[..., None, :] + np.einsum("neij,kj->neki", turned, 20.0 * PENTAGON)
    away = np.linalg.norm(places, axis=-1)
    d = np.maximum(np.abs(away - radius_m), 0.5)
    times = np.arctan2(places[..., 1], places[..., 0]) * radius_m / speed + d / SOUND
    shape = d.shape
    return Arcs(
        radius_m,
        speed,
        Passes(
            places,
            times + 0.1 * rng.standard_normal(shape),
            1000.0 / d * (1.0 + 0.1 * rng.standard_normal(shape)),
            np.full(shape, 0.1),
            np.full(shape, 0.1),
        ),
    )
