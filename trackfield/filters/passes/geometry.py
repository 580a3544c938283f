"""A straight path at constant speed past sensors: when and how far away it passes each of them.

A *line* (..., 4) is (T, gx, gy, b), about an origin: the slowness g = v / |v|^2 in s/m, the time T at which the target
is nearest to the origin, and b, how far to the right of the origin it passes then, in m. With the unit vectors e = g /
|g| and n = (e_y, -e_x), to its right, a sensor at s hears it loudest at (Yang et al., eq. 3)

    t = T + g . s + d / c,  d = |q|,  q = n . s - b.

The times are linear in T and g but for the delay of sound d / c.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from trackfield.filters.types import Array


def right(vectors: Array) -> Array:
    """Vectors (..., 2) turned by 90 degrees to the right."""
    return np.stack((vectors[..., 1], -vectors[..., 0]), axis=-1)


def across(line: Array, at: Array) -> Array:
    """q (..., K): how far to the right of the path sensors at (..., K, 2) stand, m."""
    n = right(unit(line[..., 1:3]))
    q: Array = dot(at, n) - line[..., 3:4]
    return q


def arrivals(line: Array, at: Array, sound_m_s: float) -> Array:
    """t (..., K): when sensors at (..., K, 2) hear the target loudest, s."""
    t: Array = line[..., 0:1] + dot(at, line[..., 1:3]) + np.abs(across(line, at)) / sound_m_s
    return t


def state(line: Array) -> Array:
    """(..., 4) x, y, vx, vy from the origin at the time T of the line."""
    g = line[..., 1:3]
    place = line[..., 3:4] * right(unit(g))
    return np.concatenate((place, g / np.square(g).sum(axis=-1, keepdims=True)), axis=-1)


def state_slopes(line: Array) -> Array:
    """d state/dline (..., 4, 4), of the state at the time T that the line has now."""
    g = line[..., 1:3]
    slowness = np.linalg.norm(g, axis=-1)[..., None]
    e = g / slowness
    n = right(e)
    slopes = np.zeros((*line.shape[:-1], 4, 4))
    slopes[..., :2, 0] = -e / slowness
    slopes[..., :2, 1:3] = -line[..., 3, None, None] * e[..., :, None] * n[..., None, :] / slowness[..., None]
    slopes[..., :2, 3] = n
    slopes[..., 2:, 1:3] = (np.eye(2) - 2.0 * e[..., :, None] * e[..., None, :]) / np.square(slowness)[..., None]
    return slopes


def line_of(mean: Array) -> Array:
    """The line through a state (..., 4) from the origin, T counted from the state's instant."""
    place, velocity = mean[..., :2], mean[..., 2:4]
    square = np.square(velocity).sum(axis=-1, keepdims=True)
    time = -(place * velocity).sum(axis=-1, keepdims=True) / square
    offset = (place * right(unit(velocity))).sum(axis=-1, keepdims=True)
    return np.concatenate((time, velocity / square, offset), axis=-1)


def place(at: Array, number: npt.NDArray[np.intp]) -> Array:
    """The place (..., 2) of one sensor of each event, of those at (..., K, 2)."""
    return np.take_along_axis(at, number[..., None, None], axis=-2)[..., 0, :]


def unit(vectors: Array) -> Array:
    """Vectors (..., 2) of length 1 in the same directions."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))


def dot(at: Array, vectors: Array) -> Array:
    """(..., K): the products of places (..., K, 2) with one vector (..., 2) each."""
    return np.asarray(np.einsum("...ki,...i->...k", at, vectors))
