"""How targets move, on the state (x, y, vx, vy) in metres and metres per second.

The matrices are rows of floats, so that numpy-free code can use them; ``numpy.array`` takes them as they are.
"""

from __future__ import annotations

Rows = tuple[tuple[float, ...], ...]


def transition(dt: float) -> Rows:
    """F (4x4) of nearly constant velocity, x_t = F x_{t-1} + Gamma v (Zhai et al. 2009, eq. 3)."""
    return ((1.0, 0.0, dt, 0.0), (0.0, 1.0, 0.0, dt), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def noise_gain(dt: float) -> Rows:
    """Gamma (4x2): what an acceleration in m/s^2, held over ``dt`` seconds, adds to the state."""
    half = dt * dt / 2.0
    return ((half, 0.0), (0.0, half), (dt, 0.0), (0.0, dt))


def process_noise(dt: float, sigma_v: float) -> Rows:
    """Q = Gamma sigma_v^2 Gamma^T (4x4, rank 2), the acceleration of sd ``sigma_v`` m/s^2 per axis."""
    return _spread(noise_gain(dt), sigma_v)


def white_acceleration(dt: float, q: float) -> Rows:
    """Noise (2x2) of the place and velocity of one axis, whose acceleration is white with density ``q`` (m^2/s^3).

    Özfidan et al. (2018), eqs. 5 and 6; Q over (x, y, vx, vy) has rank 4, unlike that of ``process_noise``.
    """
    return ((q * (dt**3 / 3.0), q * (dt**2 / 2.0)), (q * (dt**2 / 2.0), q * dt))


def standing_transition() -> Rows:
    """F (4x4) of a target that stands: its position stays, and its velocity becomes zero."""
    return ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))


def standing_noise(dt: float, sigma: float) -> Rows:
    """Q (4x4) of a standing target with jitter: a velocity of sd ``sigma`` m/s per axis, new each step."""
    return _spread(((dt, 0.0), (0.0, dt), (1.0, 0.0), (0.0, 1.0)), sigma)


def _spread(gain: Rows, sd: float) -> Rows:
    return tuple(tuple(sd**2 * sum(a * b for a, b in zip(r, s, strict=True)) for s in gain) for r in gain)
