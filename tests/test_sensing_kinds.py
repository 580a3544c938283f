"""The door that all kinds of sensing come through: what it refuses, and what it fills in."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from math import dist, inf
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest

import trackfield as tf
from launcher.plan.prepare import planned
from launcher.plan.probe import probe
from tests.rangers import Distance, Ranger
from tests.sensing import registered
from trackfield.models.noise import Colour
from trackfield.models.unknowns import Unknown
from trackfield.sensing.complete import Kind
from trackfield.sensing.kinds import make_sensor
from trackfield.world.faulty import with_faults
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene

NS = 1_000_000_000


@pytest.fixture(autouse=True)
def kinds() -> Iterator[None]:
    with registered(ranger=Ranger, distance=Distance):
        yield


def of(**members: Any) -> type:
    """A kind like ``Ranger``, two numbers, but for these members."""
    return type("Odd", (Ranger,), {"__init__": lambda self: None, **members})


def refused(**members: Any) -> str:
    """What is said of a kind with these members."""
    with registered(odd=of(**members)), pytest.raises(tf.ScenarioError) as caught:
        probe(make_sensor("odd", {}))
    return str(caught.value)


# --- what is refused --------------------------------------------------------------------------------------------------

NAN = float("nan")
METRES = "expected metres, above 0: from 0.001 to"
SMALL = "expected a tuple of numbers above 0: from 1e-12 to 1e+12"
LEVELS = "expected None, or the lowest and the highest level"
COLOUR = "expected None, or a Colour(slow, slow_s, fixed): shares of at most 1 together, seconds above 0"
UNKNOWNS = "expected a tuple of Unknown(name, sd, walk_sd, mean), at most 8, sd above 0"


@pytest.mark.parametrize(
    ("member", "value", "expected"),
    [
        *(("range_m", value, METRES) for value in (0.0, -3.0, NAN, inf, "far", None)),
        *(("sd", value, SMALL) for value in ((), (0.0, 1.0), (1.0, -1.0), (1.0, NAN), (1.0, inf), 1.0, [1.0, 1.0])),
        *(("resolution", value, SMALL) for value in ((), (1.0, 0.0), (NAN, 1.0), 0.1, None)),
        *(("report_m", value, METRES) for value in (0.0, NAN, "far")),
        *(("fix_sensors", value, "expected a whole number of at least 1") for value in (0, -1, 1.5, "two")),
        *(("units", value, "expected a tuple of texts") for value in ("mm", ("m", 1), ["m", "m"])),
        *(("layer", value, "expected one of rays, rings, discs, or an empty text") for value in ("arrows", 1)),
        *(("rhythm", value, "expected steps or events") for value in ("step", None)),
        *(("thresholds", value, LEVELS) for value in ((2.0, 1.0), (1.0,), 3)),
        *(("passes", value, "expected True or False") for value in (None, 1, "yes")),
        *(("memory_s", value, "expected seconds, from 0 to 1e+09") for value in (-1.0, NAN, inf, "long", None)),
        *(
            ("colour", value, COLOUR)
            for value in (
                0.5, (0.5, 1.0, 0.5), Colour(-0.1), Colour(1.1), Colour(0.6, 1.0, 0.5), Colour(0.5, 0.0),
                Colour(0.5, -1.0), Colour(0.5, 1.0, -0.1), Colour(NAN), Colour(0.5, NAN), Colour(0.5, inf),
            )
        ),
        *(("speed_m_s", value, "expected metres per second, above 0") for value in (0.0, -343.0, NAN, "fast")),
        ("unknowns", Unknown("power", 1.0, 0.1), UNKNOWNS),
        ("unknowns", ("power",), UNKNOWNS),
        ("unknowns", (Unknown("power", 0.0, 0.1),), UNKNOWNS),
        ("unknowns", (Unknown("power", 1.0, -0.1),), UNKNOWNS),
        ("unknowns", (Unknown("power", 1.0, 0.1, NAN),), UNKNOWNS),
        ("unknowns", tuple(Unknown(f"u{i}", 1.0, 0.1) for i in range(9)), UNKNOWNS),
    ],
)  # fmt: skip
def test_a_member_that_no_kind_can_have(member: str, value: object, expected: str) -> None:
    assert re.match(rf"sensor\.{member}: 'odd' has .+; {re.escape(expected)}", refused(**{member: value}))


@pytest.mark.parametrize(
    ("members", "says"),
    [
        (
            {"sd": (1.0,) * 3},
            "sensor.sd: 'odd' has 3 sd and 2 resolutions; expected one of each per number, at most 26",
        ),
        (
            {"sd": (1.0,) * 27, "resolution": (1.0,) * 27},
            "sensor.sd: 'odd' has 27 sd and 27 resolutions; expected one of each per number, at most 26",
        ),
        ({"units": ("m",)}, "sensor.units: 'odd' has ('m',); expected a text for each number"),
        (
            {"thresholds": (1.0, 2.0)},
            "sensor.level: 'odd' has none; expected a method level: it has thresholds",
        ),
        (
            {"draws": ("a", "b"), "colour": Colour(0.5)},
            "sensor.draws: 'odd' has ('a', 'b'), and a colour; expected one of the two",
        ),
        *(
            ({"simulate": method}, f"sensor 'odd': simulate: takes {count} arguments; expected {WAYS}")
            for WAYS in ["(scene, t_ns, place, normals), or (target, place, normals), without defaults"]
            for count, method in (
                ("2", lambda self, target, place: None),
                ("5", lambda self, scene, t_ns, place, normals, more: None),
                ("0", lambda self: None),
                ("any number of", lambda self, *args: None),
                ("any number of", lambda self, target, place, normals, *more: None),
                ("any number of", lambda self, target, place, normals, more=0: None),
                ("any number of", partial(print, "simulate")),
            )
        ),
    ],
)  # fmt: skip
def test_members_that_do_not_go_together(members: dict[str, Any], says: str) -> None:
    assert refused(**members) == says


@dataclass(frozen=True)
class Passing(Ranger):
    """A kind that reports passes, with all that takes."""

    time_sd_s: float = 0.1
    strength_sd: float = 0.1
    place_sd_m: float = 0.0
    passes = True
    sd = resolution = (1.0,) * 3
    distance_power = speed_power = 0.0

    def time_sd(self, away_m: Any, speed_m_s: Any, *, larger: Any) -> Any:
        return self.time_sd_s


def test_a_kind_that_reports_passes_says_what_their_noise_is() -> None:
    """Trackers may take it to be larger; nothing that this needs may be missing."""
    with registered(odd=Passing):
        larger = make_sensor("odd", {}).assumed(2.0).passes
    assert larger is not None and larger.time_sd_s == 0.2
    numbers = "time_sd_s, strength_sd, place_sd_m, distance_power, speed_power"
    expected = f"expected a dataclass with numbers {numbers} and a method time_sd"
    assert refused(passes=True) == f"sensor.passes: 'odd' lacks {numbers}, time_sd; {expected}"
    for member, value in (("time_sd", None), ("strength_sd", "much"), ("distance_power", None), ("place_sd_m", -1.0)):
        assert refused_passing(**{member: value}) == f"sensor.passes: 'odd' lacks {member}; {expected}"
    few = refused_passing(sd=(1.0, 1.0), resolution=(1.0, 1.0))
    assert few == "sensor.passes: 'odd' has 2; expected at least 3 numbers: a time (s), a strength (dB), a width (s)"


def refused_passing(**members: Any) -> str:
    """What is said of a kind like ``Passing``, but for these members."""
    made = type("Odd", (Passing,), {"__init__": lambda self: None, **members})
    with registered(odd=made), pytest.raises(tf.ScenarioError) as caught:
        make_sensor("odd", {})
    return str(caught.value)


@pytest.mark.parametrize(
    ("members", "says"),
    [
        (
            {"variance": lambda self, x, at: np.ones((*x.shape[:-1], len(at)))},
            "sensor 'odd': variance: returned an array (2, 3) for arrays (2, 4) and (3, 2); expected (2, 3, 2)",
        ),
        (
            {"variance": lambda self, x, at: self.h(x, at) * 0.0},
            "expected finite numbers above 0, at any distance",
        ),
        (
            {"variance": lambda self, x, at: self.h(x, at) * inf},
            "expected finite numbers above 0, at any distance",
        ),
        (
            {"log_clutter": lambda self, z, at: -1.0},
            "sensor 'odd': log_clutter: returned an array () for arrays (3, 2) and (3, 2); expected (3,)",
        ),
        (
            {"log_clutter": lambda self, z, at: z},
            "sensor 'odd': log_clutter: returned an array (3, 2) for arrays (3, 2) and (3, 2); expected (3,)",
        ),
        ({"loudness": lambda self, z: z}, "sensor 'odd': loudness: returned an array (3, 2) for arrays (3, 2)"),
        ({"drawn": lambda self, values: "far"}, "sensor 'odd': drawn: returned 'far'; expected a number"),
        ({"drawn": lambda self: 1.0}, "sensor 'odd': drawn: TypeError: "),
        ({"loudness": lambda self, z: z.decibels}, "sensor 'odd': loudness: AttributeError: "),
        (
            {"unknowns": (Unknown("power", 1.0, 0.1),)},
            "sensor 'odd': jacobian: returned an array (2, 3, 2, 4) for arrays (2, 5) and (3, 2); expected (2, 3",
        ),
    ],
)
def test_methods_are_tried_before_a_run(members: dict[str, Any], says: str) -> None:
    assert says in refused(**members)


def test_a_run_is_refused_with_the_same_words() -> None:
    members = {"loudness": lambda self, z: z}
    with registered(odd=of(**members)), pytest.raises(tf.ScenarioError) as caught:
        planned(tf.Scenario.load("zhai-spcpf", {"sensor.kind": "odd", "fusion.trackers": ["ekf"]}))
    assert str(caught.value) == refused(**members)


def test_thresholds_go_with_a_level() -> None:
    members = {"thresholds": (1.0, 3.0), "level": lambda self, values: values[0]}
    with registered(odd=of(**members)):
        kind = make_sensor("odd", {})
    assert (kind.threshold, kind.adaptive, kind.reading((1.5, 0.0)).level) == (2.0, True, 1.5)


def test_the_former_name_of_the_arrays_leads_to_the_present_one() -> None:
    with pytest.raises(tf.ScenarioError, match=r"sensor\.kind: 'acoustic' is called otherwise now; expected 'doa'"):
        planned(tf.Scenario.load("zhai-spcpf", {"sensor.kind": "acoustic", "sensor.level_db": 70.0}))
    with registered(acoustic=Ranger):
        assert make_sensor("acoustic", {}).name == "acoustic"  # a user's own may be called so


SOUNDER = """
from math import dist


class Sounder:
    range_m, sd, resolution, units = 100.0, (1.0,), (0.1,), ("m",)

    def simulate(self, target, position, normals):
        return (dist(target[:2], position) + normals[0],)

    def h(self, states, positions):
        raise NotImplementedError

    jacobian = h
"""


def test_a_node_with_a_users_kind_loads_nothing_that_is_heavy(tmp_path: FilePath) -> None:
    (tmp_path / "sounder.py").write_text(SOUNDER)
    plain = at_origin(Kind("sounder", Distance()), NEAR).to_plain()
    code = f"""
import sys
import node.role, trackfield.drivers.spec
from math import inf
from trackfield.plugins import give
from trackfield.world.placed import Placed
give({{"sensor:sounder": "sounder:Sounder"}}, installed=False)
reading = Placed.from_plain({plain!r}).sample({5 * NS})
print(type(reading.report(5)).__name__, *{{"numpy", "pydantic", "difflib"}} & sys.modules.keys())
"""
    paths = {"PYTHONPATH": os.pathsep.join((str(tmp_path), *sys.path))}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, env=os.environ | paths
    )
    assert (done.stdout, done.stderr) == ("Measurement\n", "")


# --- what simulate is given -------------------------------------------------------------------------------------------

NEAR = Path.of([(0.0, 0.0, 30.0, 2.0, 0.0), (10.0, 20.0, 30.0, 2.0, 0.0)])
FAR = Path.of([(0.0, 0.0, 60.0, 0.0, 0.0), (20.0, 0.0, 60.0, 0.0, 0.0)])


def at_origin(kind: Kind, *paths: Path) -> Placed:
    return Placed("n1", (0.0, 0.0), Scene(paths), ((0, 20 * NS),), kind, {}, -inf, seed=1)


def test_with_three_arguments_it_gets_the_nearest_target_within_range() -> None:
    given: list[Any] = []

    class Old(Ranger):
        def simulate(self, target: Any, position: Any, normals: Any) -> Any:
            given.append((target, position, len(normals)))
            return 1.0, 2.0

    sensor = at_origin(Kind("old", Old(range_m=50.0)), FAR, NEAR)
    assert sensor.sample(5 * NS) is not None
    assert given == [((10.0, 30.0, 2.0, 0.0), (0.0, 0.0), 2)]
    assert sensor.sample(12 * NS) is None  # the near one is gone, the other is 60 m away
    assert at_origin(Kind("old", Old(range_m=60.0)), FAR, NEAR).sample(12 * NS) is not None
    assert [target for target, *_ in given[1:]] == [(0.0, 60.0, 0.0, 0.0)]


def test_with_four_arguments_it_gets_the_scene() -> None:
    @dataclass(frozen=True)
    class Counter(Ranger):
        def simulate(self, scene: Any, t_ns: int, place: Any, normals: Any) -> Any:  # type: ignore[override]
            return len(scene.at(t_ns)), t_ns / NS

    sensor = at_origin(Kind("counter", Counter(range_m=1.0)), FAR, NEAR)
    values = [reading.values for t in (5, 12, 25) if (reading := sensor.sample(t * NS))]
    assert values == [(2, 5.0), (1, 12.0), (0, 25.0)]  # all targets, whatever its range


# --- a bias in a kind's own units -------------------------------------------------------------------------------------


def test_a_bias_shifts_readings_by_exactly_that() -> None:
    sensor = at_origin(make_sensor("ranger", {}), NEAR)
    biased = with_faults(sensor, [{"kind": "bias", "from_ns": 3 * NS, "until_ns": 8 * NS, "bias": (2.5, -40.0)}])
    for t in range(10):
        true, read = sensor.sample(t * NS), biased.sample(t * NS)
        assert true is not None and read is not None
        by = (2.5, -40.0) if 3 <= t < 8 else (0.0, 0.0)
        assert read.values == tuple(value + off for value, off in zip(true.values, by, strict=True))


def test_a_bias_of_a_scenario_reaches_its_nodes() -> None:
    fault = {"kind": "bias", "nodes": ["n012"], "at_s": 2.0, "by": [2.5, -40.0]}
    field = {"sensor.kind": "ranger", "fusion.trackers": ["ekf"], "target.steps": 5}
    plan = planned(tf.Scenario.load("zhai-spcpf", field | {"faults": [fault]}))
    faults = {process.id: process.faults for process in plan.processes if process.role == "node"}
    assert [one["bias"] for one in faults.pop("n012")] == [(2.5, -40.0)]
    assert not any(faults.values())


def test_in_a_mixed_field_a_bias_goes_by_the_kind_of_its_nodes() -> None:
    """One number for a sensor of one, two for a sensor of two; the wrong count is refused."""
    field = {
        "sensor.kind": "ranger",
        "sensors": [{"kind": "distance", "nodes": ["n012"]}],
        "fusion.trackers": ["ekf"],
        "target.steps": 5,
    }
    for node, by, says in (
        ("n012", [2.5], ""),
        ("n013", [2.5, 1.0], ""),
        ("n012", [2.5, 1.0], "has 2 numbers, and a reading of kind 'distance' has 1; expected a list of 1"),
        ("n013", [2.5], "has 1 numbers, and a reading of kind 'ranger' has 2; expected a list of 2"),
    ):
        faults = [{"kind": "bias", "nodes": [node], "at_s": 2.0, "by": by}]
        try:
            planned(tf.Scenario.load("zhai-spcpf", field | {"faults": faults}))
        except tf.ScenarioError as error:
            assert says and str(error) == f"faults[0].by: {says}"
        else:
            assert not says


def test_the_distance_is_that_of_the_geometry() -> None:
    """The helpers' own readings, so that the tests above are of what they seem to be."""
    reading = at_origin(make_sensor("distance", {}), NEAR).sample(5 * NS)
    assert reading is not None and reading.values[0] == pytest.approx(dist((10.0, 30.0), (0.0, 0.0)), abs=2.5)
