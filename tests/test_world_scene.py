"""The targets as what arrives now left them, against exact answers, and what of their paths a node must know for it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import dist, hypot, inf, sqrt
from typing import Any

import numpy as np
import pytest

import trackfield as tf
from tests.sensing import registered
from trackfield.scenario import survey
from trackfield.sensing.complete import Kind
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene, Still
from trackfield.world.targets import s2, waypoints

NS = 1_000_000_000
SOUND = 343.0
HERE = (30.0, -20.0)


def straight(x: float, y: float, vx: float, vy: float, from_s: float = 0.0, to_s: float = 100.0) -> Path:
    """At (x, y) at 0 s, with a constant velocity."""
    ends = ((t, x + vx * t, y + vy * t, vx, vy) for t in (from_s, to_s))
    return Path.of(ends)


def left_exactly(x: float, y: float, vx: float, vy: float, t: float, speed: float) -> float:
    """The earlier root s of (x + vx s - px)^2 + (y + vy s - py)^2 = c^2 (t - s)^2."""
    east, north = x - HERE[0], y - HERE[1]
    a = vx * vx + vy * vy - speed * speed
    b = east * vx + north * vy + speed * speed * t
    c = east * east + north * north - speed * speed * t * t
    return min((-b + sign * sqrt(b * b - a * c)) / a for sign in (1, -1))


@pytest.mark.parametrize("speed", [SOUND, 60.0, 3e5])
@pytest.mark.parametrize("velocity", [(8.0, 3.0), (-50.0, 10.0), (0.0, 0.0), (0.0, -59.0)])
def test_a_target_at_constant_velocity_is_where_the_quadratic_says(speed: float, velocity: tuple[float, float]) -> None:
    vx, vy = velocity
    scene = Scene((straight(40.0, 60.0, vx, vy),))
    for t in range(3, 100, 4):
        left = left_exactly(40.0, 60.0, vx, vy, t, speed)
        (found,) = scene.retarded(t * NS, HERE, speed)
        assert found == pytest.approx((40.0 + vx * left, 60.0 + vy * left, vx, vy), abs=1e-6)


def test_infinitely_fast_it_is_where_it_is() -> None:
    scene = Scene((s2(), straight(0.0, 0.0, 5.0, 5.0)))
    for t in (0, 3 * NS, 22 * NS + 1, 74 * NS, 75 * NS, 76 * NS):
        there = np.array(scene.at(t))
        assert len(there) == (2 if t <= 75 * NS else 1)
        assert np.array(scene.retarded(t, HERE, inf)) == pytest.approx(there, abs=1e-9)


def test_a_target_is_heard_from_when_its_first_sound_arrives_until_its_last_one_has() -> None:
    """There from 10 s to 20 s, and 343 m away at first, 686 m at last: heard from 11 s to 22 s."""
    scene = Scene((Path.of([(10.0, 343.0, 0.0, 34.3, 0.0), (20.0, 686.0, 0.0, 34.3, 0.0)]),))
    heard = [scene.retarded(round(t * NS), (0.0, 0.0), SOUND) for t in (10.0, 10.9999, 11.0001, 21.9999, 22.0001, 90.0)]
    assert [len(one) for one in heard] == [0, 0, 1, 1, 0, 0]
    assert heard[2][0][0] == pytest.approx(343.0, abs=0.01)
    assert heard[3][0][0] == pytest.approx(686.0, abs=0.01)


def test_near_the_start_of_a_path_a_target_that_leaves_is_found() -> None:
    """From 0 s on, a hair from the sensor and away from it at 300 m/s: at 2 s, what left it at 1.0667 s arrives."""
    (found,) = Scene((Path.of([(0.0, 1e-6, 0.0, 300.0, 0.0), (2.0, 600.0, 0.0, 300.0, 0.0)]),)).retarded(
        2 * NS, (0.0, 0.0), SOUND
    )
    assert found[0] == pytest.approx(300.0 * 2.0 * SOUND / (SOUND + 300.0), abs=1e-5)


def test_where_the_velocity_jumps_what_left_before_has_the_velocity_before() -> None:
    path = waypoints([(0.0, 343.0, 0.0), (10.0, 343.0, 100.0), (20.0, 243.0, 100.0)])
    at_corner = hypot(343.0, 100.0) / SOUND
    before, after = (
        Scene((path,)).retarded(round((10.0 + at_corner + d) * NS), (0.0, 0.0), SOUND) for d in (-0.01, 0.01)
    )
    assert [before[0][2:], after[0][2:]] == [(0.0, 10.0), (-10.0, 0.0)]


def test_along_a_curve_what_arrives_left_where_it_is_said_to_have_been() -> None:
    path = s2()
    for t in np.linspace(1.0, 75.0, 400):
        ((x, y, *_),) = Scene((path,)).retarded(round(t * NS), HERE, SOUND)
        assert path.at(t - dist((x, y), HERE) / SOUND) == pytest.approx((x, y, *_), abs=1e-6)


def test_one_that_rests_is_where_it_is() -> None:
    assert Still((1.0, 2.0, 0.0, 0.0)).retarded(5, HERE, SOUND) == ((1.0, 2.0, 0.0, 0.0),)


# --- what a node knows ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Delayed:
    """Where all targets were when their sound left them: nothing that it measures is lost, however far away."""

    range_m: float = 500.0

    speed_m_s = SOUND
    sd = (1.0, 1.0, 1.0)
    resolution = (1e-9, 1e-9, 1.0)

    def simulate(self, scene: Any, t_ns: int, place: Any, normals: Any) -> tuple[float, ...] | None:
        heard = scene.retarded(t_ns, place, SOUND)
        return (sum(one[0] for one in heard), sum(one[1] for one in heard), len(heard)) if heard else None

    def h(self, x: Any, at: Any) -> Any:
        return np.zeros((*x.shape[:-1], len(at), 3))

    def jacobian(self, x: Any, at: Any) -> Any:
        return np.zeros((*x.shape[:-1], len(at), 3, 4))


@pytest.fixture(autouse=True)
def delayed() -> Iterator[None]:
    with registered(delayed=Delayed):
        yield


def crossing(seed: int, legs: int = 40) -> Path:
    """Legs of 25 s between random places of a field of 6 km, at up to 300 m/s."""
    draw = np.random.default_rng(seed)
    return waypoints([(25.0 * k, *map(float, draw.uniform(-3000.0, 3000.0, 2))) for k in range(legs)])


WINDOWS = ((30 * NS, 33 * NS), (200 * NS, 201 * NS), (955 * NS, 990 * NS))


def test_the_part_of_the_paths_that_a_node_is_told_suffices() -> None:
    """The same samples, bit for bit, at all instants of its windows, although targets are kilometres away."""
    paths = tuple(crossing(seed) for seed in range(4))
    here = Placed("n1", (100.0, 50.0), Scene(paths), WINDOWS, Kind("delayed", Delayed()), {}, -inf, 1)
    there = Placed.from_plain(here.to_plain())
    assert sum(len(path.t) for path in there.scene.paths) < 0.2 * sum(len(path.t) for path in paths)
    counts = set()
    for begin, end in WINDOWS:
        for t in np.linspace(begin, end, 200).astype(int).tolist():
            sample = here.sample(t)
            assert there.sample(t) == sample
            counts.add(0 if sample is None else sample.values[2])
    assert counts > {4.0}  # all of them, and at the end some are gone


def test_a_node_is_awake_whenever_a_target_within_range_is_heard() -> None:
    """Instants at which what arrives left the target within 500 m lie within its windows; it stays for 1.5 s longer."""
    settings = {"sensor.kind": "delayed", "fusion.trackers": ["ekf"], "field.nodes": 9}
    target = {"target.path": "waypoints", "target.waypoints": [[0, -2000, 100], [40, 2000, 130]], "target.steps": 40}
    site = survey(tf.Scenario.load("zhai-spcpf", settings | target))
    late = 0
    for index, (_, *place) in enumerate(site.sensors):
        sensor = site.sensor(index)
        there = Placed.from_plain(sensor.to_plain())
        for t in range(0, site.end_ns, NS // 20):
            near = [one for one in sensor.scene.retarded(t, tuple(place), SOUND) if dist(one[:2], place) <= 500.0]
            if near:
                start = sensor.next_window(t)
                assert start is not None and start <= t
                assert there.sample(t) == sensor.sample(t) is not None
                late += dist(sensor.scene.at(t)[0][:2], place) > 500.0
    assert late > 20  # it is out of range already when what it is heard by arrives
