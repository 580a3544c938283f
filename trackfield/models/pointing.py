"""A camera that turns: where it has to look, when it looks there, and where things are in its picture.

Angles are in degrees. *Pan* is from the direction in which the camera stands, positive to its right (clockwise from
above), *tilt* upwards from the horizon, as with a Sony EVI-D30. No arrays: camera control is a small device, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from math import atan2, copysign, cos, degrees, hypot, inf, isfinite, radians, sin, sqrt, tan
from typing import Final, NamedTuple

AIM_M: Final = 0.75
"""The height at which a camera looks at a vehicle: half of its own."""


class Direction(NamedTuple):
    """Pan and tilt (deg)."""

    pan: float
    tilt: float


AHEAD: Final = Direction(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Mount:
    """Where a camera is (m; ``z_m`` above ground), and where it looks at pan 0, anticlockwise from east."""

    x_m: float
    y_m: float
    z_m: float
    heading_deg: float


@dataclass(frozen=True, slots=True)
class Optics:
    """Limits of a camera: it turns by at most so much each way (deg), so fast (deg/s), and sees so wide (deg).

    The picture is ``width`` by ``height`` pixels, square ones.
    """

    pan: float
    tilt: float
    pan_s: float
    tilt_s: float
    wide: float
    width: int
    height: int


EVI_D30: Final = Optics(pan=100.0, tilt=25.0, pan_s=80.0, tilt_s=50.0, wide=48.8, width=640, height=480)
"""A Sony EVI-D30 at the wide end of its zoom (its technical manual, specifications)."""


def towards(mount: Mount, x_m: float, y_m: float, z_m: float = AIM_M) -> Direction:
    """The direction in which a point is."""
    dx, dy = x_m - mount.x_m, y_m - mount.y_m
    return Direction(_pan(mount, dx, dy), degrees(atan2(z_m - mount.z_m, hypot(dx, dy))))


def _pan(mount: Mount, dx: float, dy: float) -> float:
    return (mount.heading_deg % 360 - degrees(atan2(dy, dx)) + 180.0) % 360.0 - 180.0


def in_reach(to: Direction, optics: Optics = EVI_D30) -> bool:
    """Whether a camera can look there."""
    return abs(to.pan) <= optics.pan and abs(to.tilt) <= optics.tilt


def limited(to: Direction, optics: Optics = EVI_D30) -> Direction:
    """There, or as near to it as a camera can look."""
    return Direction(_within(to.pan, optics.pan), _within(to.tilt, optics.tilt))


class Motion(NamedTuple):
    """A turn: both axes begin at once, each moves at its speed (deg/s) until it is there, and then rests."""

    start: Direction
    to: Direction
    pan_s: float
    tilt_s: float

    def at(self, seconds: float) -> Direction:
        """Where the camera looks so long after it has begun to turn."""
        return Direction(
            _turned(self.start.pan, self.to.pan, self.pan_s * max(seconds, 0.0)),
            _turned(self.start.tilt, self.to.tilt, self.tilt_s * max(seconds, 0.0)),
        )

    @property
    def lasts_s(self) -> float:
        """How long it takes until both axes rest; infinity if an axis has to move and has no speed."""
        return max(
            _lasts(self.to.pan - self.start.pan, self.pan_s), _lasts(self.to.tilt - self.start.tilt, self.tilt_s)
        )


def _turned(start: float, to: float, by: float) -> float:
    return to if abs(to - start) <= by else start + copysign(by, to - start)


def _lasts(turn: float, speed: float) -> float:
    return 0.0 if not turn else abs(turn) / speed if speed > 0 else inf


def slew_s(start: Direction, to: Direction, optics: Optics = EVI_D30) -> float:
    """How long it takes to turn, both axes at once, each at its highest speed."""
    return Motion(start, to, optics.pan_s, optics.tilt_s).lasts_s


class Pixel(NamedTuple):
    """Where a point is in the picture: from its left, from its top; outside of it too."""

    u: float
    v: float


def project(
    mount: Mount, look: Direction, x_m: float, y_m: float, z_m: float, optics: Optics = EVI_D30, zoom: float = 1.0
) -> Pixel | None:
    """Where a point is in the picture of a pinhole camera that looks there; None if it is behind the camera."""
    yaw = radians(mount.heading_deg % 360 - look.pan % 360)
    tilt = radians(look.tilt % 360)
    dx, dy, dz = x_m - mount.x_m, y_m - mount.y_m, z_m - mount.z_m
    ahead, right = dx * cos(yaw) + dy * sin(yaw), dx * sin(yaw) - dy * cos(yaw)
    depth, up = ahead * cos(tilt) + dz * sin(tilt), dz * cos(tilt) - ahead * sin(tilt)
    if depth <= 1e-6:
        return None
    focal = zoom * optics.width / 2 / tan(radians(optics.wide / 2))
    return Pixel(optics.width / 2 + focal * right / depth, optics.height / 2 - focal * up / depth)


def in_view(
    mount: Mount, look: Direction, x_m: float, y_m: float, z_m: float = AIM_M, optics: Optics = EVI_D30
) -> bool:
    """Whether a point is in the picture."""
    at = project(mount, look, x_m, y_m, z_m, optics)
    return at is not None and 0 <= at.u <= optics.width and 0 <= at.v <= optics.height


class Aim(NamedTuple):
    """Where a camera meets a target: so long from now (s), there (m), looking in this direction, which is in reach."""

    after_s: float
    x_m: float
    y_m: float
    to: Direction


def intercept(
    mount: Mount,
    look: Direction,
    start: tuple[float, float, float, float],
    age_s: float,
    lead_s: float = 0.0,
    horizon_s: float = 30.0,
    optics: Optics = EVI_D30,
) -> Aim | None:
    """The earliest instant at which a camera that is told now can look at a target; None if there is none.

    ``start`` is where the target was ``age_s`` seconds ago (m), and its velocity (m/s), which is taken as constant. The
    camera looks at ``look``, begins to turn ``lead_s`` from now, and turns each axis at its highest speed. None also if
    a number is not finite. Where the camera itself is, it does not look.

    A camera can meet the target at an instant if the target is within pan and tilt then, and there was time to turn
    each axis. So the earliest instant is the first possible one, or one at which one of these begins to be so: they
    all are tried. Pan and tilt of a straight path are monotone, with a rate that rises and falls once, on each side of
    the point nearest to the camera, which brackets every such instant.
    """
    x, y, vx, vy = start
    if not all(map(isfinite, (*start, age_s, lead_s, horizon_s, *look, mount.x_m, mount.y_m, mount.z_m))):
        return None
    x, y = x + vx * age_s, y + vy * age_s
    for after in sorted(_instants(mount, look, (x, y, vx, vy), lead_s, horizon_s, optics)):
        at = (x + vx * after, y + vy * after)
        if hypot(at[0] - mount.x_m, at[1] - mount.y_m) < _LEAST_M:
            continue
        to = towards(mount, *at)
        near = limited(to, optics)
        missing = abs(near.pan - to.pan), abs(near.tilt - to.tilt), lead_s + slew_s(look, near, optics) - after
        if all(one <= _EXACT for one in missing) and after <= horizon_s:
            return Aim(after, *at, near)
    return None


_EXACT: Final = 1e-7
"""Seconds and degrees that are rounding."""
_STANDS_M_S: Final = 1e-9
_LEAST_M: Final = 1e-6
"""Nearer to the camera than this, the direction of a target is nothing but rounding."""


def _within(angle: float, limit: float) -> float:
    return min(max(angle, -limit), limit)


@dataclass(frozen=True, slots=True)
class _Passing:
    """A straight path as a camera sees it: nearest at ``since_s`` (s from now), ``d_m`` away, ``up_m`` above it."""

    since_s: float
    d_m: float
    up_m: float
    speed: float
    pan: float  # of the nearest point (deg)
    side: float  # 1: it goes to the right

    def __call__(self, after_s: float) -> Direction:
        """Pan, continuously unless the path goes through the camera, so it may be off by whole turns; and tilt."""
        along = self.speed * (after_s - self.since_s)
        pan = self.pan + self.side * degrees(atan2(along, self.d_m))
        return Direction(pan, degrees(atan2(self.up_m, hypot(along, self.d_m))))

    def bends(self, optics: Optics) -> Iterator[float]:
        """Instants (s from now) between which pan and tilt, and both less a turn at full speed, are monotone."""
        yield self.since_s
        for along in (*self._pan_bends(radians(optics.pan_s)), *self._tilt_bends(radians(optics.tilt_s))):
            yield self.since_s + along / self.speed
            yield self.since_s - along / self.speed

    def _pan_bends(self, rate: float) -> Iterator[float]:
        """How far from the nearest point (m) pan changes as fast as the camera turns (rad/s)."""
        square = self.speed * self.d_m / rate - self.d_m * self.d_m
        if square > 0:
            yield sqrt(square)

    def _tilt_bends(self, rate: float) -> Iterator[float]:
        """The same of tilt, whose rate is highest at ``most``; that is where the derivative of the rate is zero."""
        nearest = max(self.d_m, _LEAST_M)
        d2, u2 = nearest * nearest, self.up_m * self.up_m

        def excess(along: float) -> float:
            far2 = d2 + along * along
            return self.speed * abs(self.up_m) * along / (sqrt(far2) * (far2 + u2)) - rate

        most = sqrt(max((sqrt(d2 * d2 + 8 * d2 * (d2 + u2)) - d2) / 4, 0.0))
        yield most
        if excess(most) > 0:
            # Far away the rate is below speed * up / along^2, so it is below ``rate`` from ``far`` on.
            far = sqrt(self.speed * abs(self.up_m) / rate)
            yield _root(excess, 0.0, most)
            yield _root(excess, most, max(far, most))


def _instants(
    mount: Mount,
    look: Direction,
    now: tuple[float, float, float, float],
    lead_s: float,
    horizon_s: float,
    optics: Optics,
) -> Iterator[float]:
    """The first possible instant (s from now), and all at which a limit begins or ceases to hold."""
    yield lead_s
    dx, dy, (vx, vy) = now[0] - mount.x_m, now[1] - mount.y_m, now[2:]
    speed = hypot(vx, vy)
    if speed < _STANDS_M_S:
        yield lead_s + slew_s(look, towards(mount, now[0], now[1]), optics)
        return
    east, north = vx / speed, vy / speed
    right = dx * north - dy * east  # the path is so far to the right of the camera, for who goes with the target
    side = copysign(1.0, right)
    path = _Passing(
        since_s=-(dx * east + dy * north) / speed,
        d_m=abs(right),
        up_m=AIM_M - mount.z_m,
        speed=speed,
        pan=_pan(mount, side * north, -side * east),
        side=-side,
    )
    yield path.since_s + 2 * _LEAST_M / speed  # when pan has jumped, if it does
    ends = sorted({lead_s, horizon_s, *(at for at in path.bends(optics) if lead_s < at < horizon_s)})
    for room in _rooms(path, look, lead_s, optics):
        for first, last in pairwise(ends):
            if (room(first) < 0) != (room(last) < 0):
                yield _root(room, first, last)


@dataclass(frozen=True, slots=True)
class _Room:
    """What is left of a limit that grows from ``limit`` by ``rate`` (deg/s) since ``lead_s``; negative: not kept.

    The limit is one of how far an axis (0 is pan) is on one side (``sign``) of ``origin`` (deg).
    """

    path: _Passing
    axis: int
    sign: float
    origin: float
    limit: float
    rate: float
    lead_s: float

    def __call__(self, after_s: float) -> float:
        away = self.sign * (self.path(after_s)[self.axis] - self.origin)
        return self.limit + self.rate * (after_s - self.lead_s) - away


def _rooms(path: _Passing, look: Direction, lead_s: float, optics: Optics) -> Iterator[_Room]:
    """Of pan and tilt: what is left of the reach, and of the time to turn."""
    for sign in (-1.0, 1.0):
        for turn in (-360.0, 0.0, 360.0):
            yield _Room(path, 0, sign, turn, optics.pan, 0.0, lead_s)
            yield _Room(path, 0, sign, turn + look.pan, 0.0, optics.pan_s, lead_s)
        yield _Room(path, 1, sign, 0.0, optics.tilt, 0.0, lead_s)
        yield _Room(path, 1, sign, look.tilt, 0.0, optics.tilt_s, lead_s)


def _root(of: Callable[[float], float], first: float, last: float) -> float:
    """Where a function changes its sign between two places, by halving; of the last two, where it is not negative."""
    rises = of(first) < 0
    for _ in range(80):
        middle = (first + last) / 2
        if not first < middle < last:
            break
        if (of(middle) < 0) == rises:
            first = middle
        else:
            last = middle
    return last if rises else first
