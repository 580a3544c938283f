"""What Yang et al. derive of errors in closed form (sec. 2, 3.2, 3.3.3): eqs. 22, 24 to 28 and 37, and a bound.

Angles are the paper's, counter-clockwise from +x, in radians; ``mach`` is v / c.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from trackfield.filters.types import Array

C: Final = 340.0
"""The speed of sound, m/s."""


class Paper(NamedTuple):
    """The errors that the paper puts in (sec. 3.2): of a place (m), of a time (s); r_3k (m) and the speed (m/s)."""

    place_m: float = 2.0
    time_s: float = 0.1
    apart_m: float = 40.0
    speed: float = 10.0


PAPER: Final = Paper()


def distance_error(place_m: float, time_s: Array, beta_phi: Array, mach: float) -> Array:
    """The error of r (m) in the original algorithm, for that of a node's place and time; eq. 22."""
    return place_m * (np.cos(beta_phi) + np.sin(beta_phi) / mach) / 2.0 - C * time_s / 2.0


def angle_error(alpha: Array, phi: Array, given: Paper = PAPER) -> Array:
    """The error of phi (rad), eq. 24, with ``alpha`` the angle of the vector from node 3 to node k."""
    a1, a2 = _factors(alpha, given.speed / C)
    above = given.place_m * (a1 * np.cos(phi) - a2 * np.sin(phi)) - C * given.time_s
    return np.asarray(above / (given.apart_m * (a1 * np.sin(phi) + a2 * np.cos(phi))))


def angle_error_of_times(alpha: Array, phi: Array, given: Paper = PAPER) -> Array:
    """The error of phi (rad) if places are exact, without its sign; eq. 26."""
    return np.abs(angle_error(alpha, phi, given._replace(place_m=0.0)))


def angle_error_of_places(alpha: Array, phi: Array, given: Paper = PAPER) -> Array:
    """The error of phi (rad) if times are exact, without its sign; eq. 27."""
    return np.abs(angle_error(alpha, phi, given._replace(time_s=0.0)))


def whole_degrees() -> tuple[Array, Array]:
    """All pairs of alpha and phi (rad), each of 0, 1, ... 359 degrees: two arrays (360, 360)."""
    grid = np.radians(np.arange(360.0))
    alpha, phi = np.meshgrid(grid, grid, indexing="ij")
    return alpha, phi


def crossing_error(apart_m: Array, strength: Array, place_m: float = PAPER.place_m) -> Array:
    """The bound on the error of r_1 (m) in the enhanced algorithm; eq. 37.

    ``apart_m`` is the distance of the two nodes on either side of the path, ``strength`` the relative error of the
    square root of a signal's amplitude.
    """
    return np.asarray(0.5 * place_m + 0.5 * apart_m * strength)


def proximity_bound(nodes: int, area_m2: float, range_m: float) -> float:
    """The error (m) that proximity sensors achieve: 1 / (density * range); sec. 2, after its reference 10."""
    return area_m2 / (nodes * range_m)


def _factors(alpha: Array, mach: float) -> tuple[Array, Array]:
    """a_1 and a_2 of eq. 24."""
    return np.sin(alpha) / mach - np.cos(alpha), np.sin(alpha) + np.cos(alpha) / mach
