"""An array of microphones: level and bearing from geometry alone, noise from the key alone."""

import subprocess
import sys
from dataclasses import replace
from math import atan2, degrees, hypot, log10
from statistics import fmean, stdev

import msgpack
import pytest

from tests.sensing import array_at, hearing
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.targets import s1

S = 1_000_000_000
# Along y = 40 from x = -100 to x = 100 at 10 m/s, past a sensor at the origin.
PASSING = Path.of([(0.0, -100.0, 40.0, 10.0, 0.0), (20.0, 100.0, 40.0, 10.0, 0.0)])
WINDOWS = ((4 * S, 16 * S),)
SENSOR = array_at((0.0, 0.0), (PASSING,), WINDOWS)


def of(*paths: Path, **options: float) -> Placed:
    """The sensor with other targets and options."""
    return array_at((0.0, 0.0), paths, WINDOWS, **options)


@pytest.mark.parametrize("t", [4.5, 8.0, 10.0, 13.25])
def test_without_noise_the_reading_is_the_geometry(t: float) -> None:
    x = -100.0 + 10.0 * t
    heard = SENSOR.sample(round(t * S))
    assert heard is not None
    assert heard.level == pytest.approx(70 - 10 * log10(hypot(x, 40)))
    assert heard.values[0] == pytest.approx(degrees(atan2(x, 40)) % 360)


@pytest.mark.parametrize(
    ("place", "bearing"), [((0.0, 5.0), 0.0), ((5.0, 0.0), 90.0), ((0.0, -5.0), 180.0), ((-5.0, 0.0), 270.0)]
)
def test_bearings_run_clockwise_from_north(place: tuple[float, float], bearing: float) -> None:
    still = Path.of([(0.0, *place, 0.0, 0.0), (1.0, *place, 0.0, 0.0)])
    heard = of(still).sample(0)
    assert heard is not None
    assert heard.values[0] == pytest.approx(bearing)


def test_a_bearing_a_hair_west_of_north_stays_below_a_full_turn() -> None:
    still = Path.of([(0.0, -1e-17, 5.0, 0.0, 0.0), (1.0, -1e-17, 5.0, 0.0, 0.0)])
    heard = of(still).sample(0)
    assert heard == hearing(pytest.approx(70 - 10 * log10(5)), 0.0)


def test_it_hears_nothing_below_the_audible_level() -> None:
    # 51 dB is 79.4 m, which is x = +-68.6 m: t = 3.14 s to 16.86 s
    assert SENSOR.sample(round(3.13 * S)) is None
    assert SENSOR.sample(round(3.15 * S)) is not None
    assert SENSOR.sample(round(16.85 * S)) is not None
    assert SENSOR.sample(round(16.87 * S)) is None


def test_it_hears_nothing_when_the_target_is_not_there() -> None:
    assert SENSOR.sample(-1) is None
    assert SENSOR.sample(21 * S) is None


def test_a_target_on_top_of_the_sensor_is_heard_at_its_source_level() -> None:
    still = Path.of([(0.0, 0.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0, 0.0)])
    assert of(still).sample(0) == hearing(70.0, 0.0)


def test_of_several_targets_the_loudest_is_heard() -> None:
    # 40 m to the north at t = 10 s, and another that stands 50 m to the east
    east = Path.of([(0.0, 50.0, 0.0, 0.0, 0.0), (30.0, 50.0, 0.0, 0.0, 0.0)])
    both, other, alone = of(PASSING, east, doa_sd_deg=3.0), of(east, doa_sd_deg=3.0), of(PASSING, doa_sd_deg=3.0)
    assert both.sample(10 * S) == alone.sample(10 * S)  # with the same noise as if it were alone
    assert both.sample(5 * S) == other.sample(5 * S)  # the first is 64 m away
    assert both.sample(25 * S) == other.sample(25 * S)  # and gone
    assert both.sample(31 * S) is None


def test_of_targets_as_loud_as_each_other_the_first_is_heard() -> None:
    north, east = (Path.of([(0.0, x, y, 0.0, 0.0), (1.0, x, y, 0.0, 0.0)]) for x, y in ((0.0, 5.0), (5.0, 0.0)))
    for paths, bearing_deg in (((north, east), 0.0), ((east, north), 90.0)):
        heard = of(*paths).sample(0)
        assert heard is not None
        assert heard.values[0] == pytest.approx(bearing_deg)


def test_it_travels_with_what_it_needs_of_each_path() -> None:
    there = array_at((200.0, 200.0), (s1(1), s1(2), PASSING), ((20 * S, 35 * S),))
    back = Placed.from_plain(msgpack.unpackb(msgpack.packb(there.to_plain())))
    assert [len(path.t) for path in back.scene.paths][:2] == [18, 18]
    for t in range(20 * S, 35 * S + 1, S // 4):
        assert back.sample(t) == there.sample(t)


def test_noise_has_the_given_spread_and_no_bias() -> None:
    # the target stands 10 m to the east-south-east, so that no bearing wraps
    still = Path.of([(0.0, 10.0, -2.0, 0.0, 0.0), (1.0, 10.0, -2.0, 0.0, 0.0)])
    quiet = of(still)
    noisy = of(still, doa_sd_deg=3.0, level_sd_db=0.5)
    exact = quiet.sample(0)
    heard = [noisy.sample(t) for t in range(4000)]
    assert exact is not None
    for number, sd in ((0, 3.0), (1, 0.5)):
        errors = [one.values[number] - exact.values[number] for one in heard if one]
        assert len(errors) == 4000
        assert fmean(errors) == pytest.approx(0.0, abs=4 * sd / 4000**0.5)
        assert stdev(errors) == pytest.approx(sd, rel=0.05)


def test_noise_belongs_to_seed_sensor_life_and_instant() -> None:
    noisy = of(PASSING, doa_sd_deg=3.0, level_sd_db=0.5)
    t = 9 * S
    assert noisy.sample(t) == noisy.sample(t)  # asking again re-rolls nothing
    others = [
        replace(noisy, seed=2).sample(t),
        replace(noisy, id="n008").sample(t),
        replace(noisy, incarnation=1).sample(t),
    ]
    assert len({noisy.sample(t), *others}) == 4
    both = [one.values for one in (noisy.sample(t), SENSOR.sample(t)) if one]
    angle, level = zip(*both, strict=True)
    assert (level[0] - level[1]) / 0.5 != pytest.approx((angle[0] - angle[1]) / 3.0)  # two draws, not one


def test_bearings_never_leave_the_circle_however_noisy() -> None:
    wild = of(PASSING, doa_sd_deg=180.0)
    for t in range(5 * S, 15 * S, S // 50):
        heard = wild.sample(t)
        assert heard is not None
        assert 0.0 <= heard.values[0] < 360.0


def test_the_next_window_is_the_one_it_is_in_or_the_one_to_come() -> None:
    twice = replace(SENSOR, windows=((2 * S, 5 * S), (9 * S, 9 * S), (12 * S, 20 * S)))
    asked = [0, 2 * S, 5 * S, 5 * S + 1, 9 * S, 9 * S + 1, 20 * S, 20 * S + 1]
    expected = [2 * S, 2 * S, 2 * S, 9 * S, 9 * S, 12 * S, 12 * S, None]
    assert [twice.next_window(t) for t in asked] == expected
    assert replace(SENSOR, windows=()).next_window(0) is None


def test_it_travels_with_no_more_of_the_path_than_it_needs_and_reads_the_same() -> None:
    there = array_at((200.0, 200.0), (s1(1),), ((20 * S, 35 * S),), doa_sd_deg=3.0)
    packed = msgpack.packb(there.to_plain())
    back = Placed.from_plain(msgpack.unpackb(packed))
    assert len(back.scene.paths[0].t) == 18  # a knot a second, one to either side
    assert len(packed) < 18 * 5 * 9 + 300
    assert (back.kind.name, back.kind.own) == ("doa", there.kind.own)
    assert replace(back, scene=there.scene, kind=there.kind) == there
    for t in range(20 * S, 35 * S + 1, S // 4):
        assert back.sample(t) == there.sample(t)


def test_a_node_can_sense_without_numpy() -> None:
    heavy = "{'numpy', 'scipy', 'pydantic', 'pymap3d'}"
    code = f"import sys, trackfield.world.placed, trackfield.sensing.doa\nprint(*{heavy} & sys.modules.keys())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "\n"
