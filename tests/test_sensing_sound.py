"""Energy over a window, of sound that takes its time: what nodes read, and what trackers make of it."""

from __future__ import annotations

from math import dist, hypot, log
from typing import Any, Final

import msgpack
import numpy as np
import pytest

import trackfield as tf
from launcher.plan.prepare import planned
from trackfield.scenario import survey
from trackfield.sensing.complete import Kind
from trackfield.sensing.energy import Energy
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene
from trackfield.world.targets import s1

NS: Final = 1_000_000_000
C: Final = 343.0
PLACE: Final = (0.0, 0.0)


def straight(offset_m: float, speed_m_s: float = 12.0) -> Path:
    """Eastwards, past the origin at 50 s, ``offset_m`` north of it."""
    return Path.of([(t, speed_m_s * (t - 50.0), offset_m, speed_m_s, 0.0) for t in (0.0, 100.0)])


def kind_of(**options: Any) -> Kind:
    return Kind("energy", Energy(**{"range_m": 1000.0, **options}))


def read(kind: Kind, path: Path, t_s: float) -> float:
    """The reading without noise."""
    values = kind.simulate(Scene((path,)), round(t_s * NS), PLACE, (0.0,))
    assert values is not None
    return float(values[0])


def expected(kind: Kind, path: Path, t_s: float) -> float:
    """What trackers expect that know the true state."""
    there = path.at(t_s)
    assert there is not None
    state = np.array([*there, log(1e5)])
    return float(kind.h(state, np.array([PLACE]))[0, 0])


def integral(path: Path, t_s: float, window_s: float, sound_m_s: float, parts: int = 4000) -> float:
    """The mean of what is received over the window that ends at ``t_s``, added up in small parts.

    Sound that arrives at t left at t - tau with c tau = d(t - tau), found by halving.
    """
    found = []
    for k in range(parts):
        now = t_s - window_s * (k + 0.5) / parts
        low, high = 0.0, 10.0
        for _ in range(50 if sound_m_s else 0):
            tau = (low + high) / 2.0
            there = path.at(now - tau)
            assert there is not None
            low, high = (tau, high) if sound_m_s * tau < dist(there[:2], PLACE) else (low, tau)
        left = path.at(now - (low if sound_m_s else 0.0))
        assert left is not None
        found.append(1e5 * hypot(*left[:2]) ** -2.0929)
    return float(np.mean(found))


@pytest.mark.parametrize("sound_m_s", [0.0, C])
@pytest.mark.parametrize(("offset_m", "t_s"), [(15.0, 50.3), (30.0, 48.0), (80.0, 53.0)])
def test_a_reading_is_the_mean_over_its_window(offset_m: float, t_s: float, sound_m_s: float) -> None:
    path = straight(offset_m)
    exact = integral(path, t_s, 1.0, sound_m_s, 400)
    assert read(kind_of(window_s=1.0, sound_m_s=sound_m_s), path, t_s) == pytest.approx(exact, rel=3e-5)


@pytest.mark.parametrize(("offset_m", "t_s"), [(5.0, 50.05), (30.0, 47.0), (80.0, 55.0), (3.0, 60.0)])
def test_the_delay_is_compensated_exactly_at_constant_velocity(offset_m: float, t_s: float) -> None:
    path = straight(offset_m, 25.0)
    heard = read(kind_of(sound_m_s=C), path, t_s)
    assert expected(kind_of(sound_m_s=C), path, t_s) == pytest.approx(heard, rel=1e-6)
    ignored = expected(kind_of(sound_m_s=C, compensate_delay=False), path, t_s)
    assert abs(ignored / heard - 1.0) > 1e-3
    assert ignored == expected(kind_of(), path, t_s)


@pytest.mark.parametrize("sound_m_s", [0.0, C])
def test_the_middle_of_a_window_stands_for_it_but_for_its_curvature(sound_m_s: float) -> None:
    """What is left falls with the square of the window; what ignoring it costs, with the window itself."""
    path = straight(30.0)
    off: dict[bool, list[float]] = {True: [], False: []}
    for window_s in (0.2, 0.1):
        for compensated, found in off.items():
            kind = kind_of(window_s=window_s, sound_m_s=sound_m_s, compensate_window=compensated)
            found.append(expected(kind, path, 46.5) / read(kind, path, 46.5) - 1.0)
    assert off[True][0] / off[True][1] == pytest.approx(4.0, rel=0.05)
    assert off[False][0] / off[False][1] == pytest.approx(2.0, rel=0.1)
    assert abs(off[True][0]) < 0.001 < abs(off[False][0])


def test_far_away_nothing_of_the_window_is_left() -> None:
    path = straight(800.0)
    kind = kind_of(window_s=1.0, sound_m_s=C)
    assert expected(kind, path, 60.0) == pytest.approx(read(kind, path, 60.0), rel=1e-4)


def test_a_node_has_all_that_its_readings_need() -> None:
    """Cut to its windows, the path gives the same readings; outside of these there are none."""
    path = s1(3)
    options = {"range_m": 60.0, "window_s": 2.0, "sound_m_s": 100.0}
    settings = {"sensor.kind": "energy", "fusion.trackers": ["ekf"], **{f"sensor.{k}": v for k, v in options.items()}}
    site = survey(tf.Scenario.load("zhai-spcpf", {**settings, "seed": 3}))
    assert site.paths["target"].x == path.x
    heard = 0
    for index in range(0, 121, 4):
        whole = site.sensor(index)
        sent = Placed.from_plain(msgpack.unpackb(msgpack.packb(whole.to_plain())))
        for t_ns in range(0, 61 * NS, NS // 4):
            inside = any(begin <= t_ns <= end for begin, end in whole.windows)
            reading = whole.sample(t_ns)
            assert inside or reading is None
            if inside:
                assert sent.sample(t_ns) == reading
                heard += reading is not None
    assert heard > 300


def test_what_arrives_late_is_heard_after_the_target_has_gone() -> None:
    """At 100 m/s from 60 m it takes 0.6 s, and a window of 2 s holds it for as long."""
    settings = {
        "field.extent_m": 100.0,
        "sensor.kind": "energy",
        "sensor.range_m": 60.0,
        "fusion.trackers": ["ekf"],
        "target": {"path": "waypoints", "waypoints": [[0, -100, 50], [40, 300, 50]]},
    }
    (first, *_) = (
        [survey(tf.Scenario.load("zhai-spcpf", settings | more)).sensor(4) for more in ({}, sound)]
        for sound in [{"sensor.window_s": 2.0, "sensor.sound_m_s": 100.0}]
    )
    at_once, late = ([t for t in range(0, 40 * NS, NS // 20) if one.sample(t)] for one in first)
    assert (at_once[-1] / NS, at_once[0] / NS) == (pytest.approx(21.0, abs=0.06), pytest.approx(9.0, abs=0.06))
    last = late[-1] / NS
    assert last == pytest.approx(21.0 + 0.6 + 2.0 * (1.0 - 0.0694), abs=0.06)
    assert planned(tf.Scenario.load("zhai-spcpf", settings)).info.layers["n004"] == "discs"
