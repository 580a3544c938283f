"""A sensor with faults: what it reads, and when it is awake."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from statistics import fmean
from typing import Any

import pytest

from tests.sensing import array_at, hearing
from trackfield.sensing.readings import Ears
from trackfield.world.faulty import with_faults
from trackfield.world.path import Path
from trackfield.world.placed import Placed

S = 1_000_000_000
# Along y = 40 from x = -100 to x = 100 at 10 m/s, past a sensor at the origin that hears 79.4 m far.
PASSING = Path.of([(0.0, -100.0, 40.0, 10.0, 0.0), (20.0, 100.0, 40.0, 10.0, 0.0)])
SENSOR = array_at((0.0, 0.0), (PASSING,), ((3 * S, 17 * S),), doa_sd_deg=3.0, level_sd_db=0.5)
THRESHOLD = 52.5


def faulty(*faults: dict[str, Any], sensor: Placed = SENSOR) -> Ears:
    return with_faults(sensor, faults)


def fault(kind: str, from_s: float, until_s: float | None = None, **more: Any) -> dict[str, Any]:
    until_ns = None if until_s is None else round(until_s * S)
    return {"kind": kind, "from_ns": round(from_s * S), "until_ns": until_ns, **more}


def test_without_faults_it_is_the_sensor_itself() -> None:
    assert with_faults(SENSOR, ()) is SENSOR


@pytest.mark.parametrize("kind", ["stuck", "bias", "deaf", "babble"])
def test_before_and_after_a_fault_it_reads_as_ever(kind: str) -> None:
    broken = faulty(fault(kind, 8, 10, **({"bias": (0.0, 5.0)} if kind == "bias" else {})))
    for t in (0, 8 * S - 1, 10 * S, 12 * S, 19 * S):
        assert broken.sample(t) == SENSOR.sample(t)
    assert broken.sample(8 * S) != SENSOR.sample(8 * S) or kind == "stuck"
    assert broken.sample(10 * S - 1) != SENSOR.sample(10 * S - 1)


def test_a_deaf_one_hears_nothing() -> None:
    assert [faulty(fault("deaf", 5)).sample(t * S) for t in (5, 10, 15)] == [None] * 3


def test_a_stuck_one_reads_what_it_read_first() -> None:
    first = SENSOR.sample(8 * S)
    assert first is not None
    broken = faulty(fault("stuck", 8, 30))
    assert {broken.sample(t) for t in range(8 * S, 30 * S, S // 3)} == {first}


def test_one_that_gets_stuck_in_silence_reads_something_above_its_threshold() -> None:
    broken = faulty(fault("stuck", 1))
    (reading,) = {broken.sample(t * S) for t in range(1, 30)}
    assert reading is not None
    assert reading.level == THRESHOLD + 3
    bearings = [
        heard.values[0]
        for id in range(1000)
        if (heard := faulty(fault("stuck", 1), sensor=replace(SENSOR, id=f"n{id}")).sample(S)) is not None
    ]
    assert fmean(bearings) == pytest.approx(180, abs=4 * 104 / 1000**0.5)
    assert max(bearings) - min(bearings) > 350


def test_a_biased_one_is_off_by_so_much_and_hears_no_more_than_before() -> None:
    broken = faulty(fault("bias", 0, bias=(-350.0, -2.0)), fault("bias", 10, bias=(20.0, 1.0)))
    for t, degrees, db in ((6, 10.0, -2.0), (12, 30.0, -1.0)):
        true, read = SENSOR.sample(t * S), broken.sample(t * S)
        assert true is not None
        assert read is not None
        assert read.level == pytest.approx(true.level + db)
        assert read.values[0] == pytest.approx((true.values[0] + degrees) % 360)
    assert broken.sample(1 * S) is None


def test_no_reading_is_louder_than_an_array_shows() -> None:
    assert faulty(fault("bias", 0, bias=(0.0, 1000.0))).sample(9 * S) == hearing(200.0, pytest.approx(354.6, abs=9))
    assert with_faults(replace(SENSOR, threshold=199.9), [fault("babble", 0)]).sample(9 * S).level <= 200.0  # type: ignore[union-attr]


def test_a_babbling_one_reads_anything_above_its_threshold() -> None:
    broken = faulty(fault("babble", 0))
    heard = [reading for t in range(2000) if (reading := broken.sample(t * S)) is not None]
    assert len(set(heard)) == 2000
    levels, bearings = [one.level for one in heard], [one.values[0] for one in heard]
    for values, low, width in ((levels, THRESHOLD, 10), (bearings, 0, 360)):
        assert low <= min(values) < low + width / 50
        assert low + width * 49 / 50 < max(values) <= low + width
        assert fmean(values) == pytest.approx(low + width / 2, abs=4 * width / 12**0.5 / 2000**0.5)


@pytest.mark.parametrize("kind", ["stuck", "babble"])
def test_what_is_made_up_belongs_to_seed_sensor_life_and_instant(kind: str) -> None:
    sensors = [SENSOR, *(replace(SENSOR, **{name: value}) for name, value in OTHERS.items())]  # type: ignore[arg-type]
    readings = [faulty(fault(kind, 1), sensor=sensor).sample(2 * S) for sensor in sensors]
    assert len(set(readings)) == len(readings)
    assert faulty(fault(kind, 1)).sample(2 * S) == readings[0]


OTHERS = {"seed": 2, "id": "n008", "incarnation": 1}


@pytest.mark.parametrize("kind", ["stuck", "babble"])
def test_one_that_reads_without_a_target_is_awake_while_it_does(kind: str) -> None:
    early, late = faulty(fault(kind, 1, 2)), faulty(fault(kind, 18))
    assert [early.next_window(t) for t in (0, S, 2 * S - 1, 2 * S, 17 * S, 17 * S + 1)] == [
        S, S, S, 3 * S, 3 * S, None
    ]  # fmt: skip
    assert [late.next_window(t) for t in (0, 17 * S, 17 * S + 1, 40 * S)] == [3 * S, 3 * S, 18 * S, 18 * S]
    around = faulty(fault(kind, 2, 5))
    assert [around.next_window(t) for t in (0, 2 * S, 4 * S, 5 * S)] == [2 * S, 2 * S, 2 * S, 3 * S]


@pytest.mark.parametrize("kind", ["bias", "deaf"])
def test_one_that_needs_a_target_is_awake_when_it_would_be_anyway(kind: str) -> None:
    broken = faulty(fault(kind, 1))
    for t in (0, 3 * S, 17 * S, 17 * S + 1):
        assert broken.next_window(t) == SENSOR.next_window(t)


def test_a_sensor_that_travelled_is_as_broken_elsewhere() -> None:
    there = Placed.from_plain(replace(SENSOR, windows=((5 * S, 9 * S),)).to_plain())
    here = replace(SENSOR, windows=((5 * S, 9 * S),))
    for kind in ("stuck", "babble", "deaf", "bias"):
        for t in (5 * S, 7 * S, 9 * S):
            broken = fault(kind, 6, **({"bias": (9.0, 1.0)} if kind == "bias" else {}))
            assert faulty(broken, sensor=there).sample(t) == faulty(broken, sensor=here).sample(t)


def test_a_node_can_be_broken_without_numpy() -> None:
    code = "import sys, trackfield.world.faulty\nprint(*{'numpy', 'scipy', 'pydantic'} & sys.modules.keys())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "\n"
