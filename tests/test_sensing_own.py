"""What is a sensor's own: offsets and gains, which trackers take off, and readings that are missing."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

import numpy as np
import pytest
from scipy.stats import norm

import trackfield as tf
from launcher.plan.prepare import planned
from launcher.record.virtually import simulate
from tests.links import SURE
from tests.rangers import Ranger
from tests.sensing import registered
from trackfield.scenario import survey
from trackfield.sensing.complete import Kind
from trackfield.sensing.energy import Energy
from trackfield.sensing.kinds import hashable, known_kind, make_sensor, own_options
from trackfield.sensing.rss import Rss
from trackfield.sensing.sensing import Numbers
from trackfield.tracking.bank import Bank
from trackfield.wire.messages import Energy as EnergyMessage
from trackfield.wire.messages import Rss as RssMessage
from trackfield.world.faulty import Faulty, SensorFault
from trackfield.world.path import Path
from trackfield.world.placed import Placed
from trackfield.world.scene import Scene

NS: Final = 1_000_000_000
STILL: Final = Scene((Path.of([(0.0, 30.0, 0.0, 0.0, 0.0), (9e4, 30.0, 0.0, 0.0, 0.0)]),))
BASE: Final[Mapping[str, Any]] = {
    "field.extent_m": 200.0,
    "target.steps": 12,
    "fusion.trackers": ["ekf"],
    "sensor.kind": "rss",
}


def placed(kind: Kind, id: str = "n001", incarnation: int = 0) -> Placed:
    return Placed(id, (0.0, 0.0), STILL, ((0, 90_000 * NS),), kind, {}, 0.0, 1, incarnation)


def values(one: Placed, steps: int = 5) -> list[float]:
    return [reading.values[0] for t in range(steps) if (reading := one.sample(t * NS)) is not None]


# --- offsets and gains ------------------------------------------------------------------------------------------------


def test_a_sensor_reads_so_much_more_than_it_would() -> None:
    plain, own = (Kind("rss", Rss(offsets=offsets)) for offsets in ({}, {"n001": 2.5}))
    assert values(placed(own)) == pytest.approx([value + 2.5 for value in values(placed(plain))])
    assert values(placed(own, "n002")) == values(placed(plain, "n002"))
    plain, own = (Kind("energy", Energy(gains=gains)) for gains in ({}, {"n001": 3.0}))
    assert values(placed(own)) == pytest.approx([3.0 * value for value in values(placed(plain))])


def test_what_a_broken_sensor_invents_is_off_as_well() -> None:
    plain, own = (Kind("rss", Rss(offsets=offsets)) for offsets in ({}, {"n001": 2.5}))
    found = [Faulty(placed(kind), (SensorFault("babble", 0),)).sample(NS) for kind in (plain, own)]
    assert found[0] is not None
    assert found[1] is not None
    assert found[1].values[0] == pytest.approx(found[0].values[0] + 2.5)


@pytest.mark.parametrize(
    ("kind", "options", "messages"),
    [
        ("rss", {"offsets": {"a": 3.0, "c": -2.0}}, {"a": RssMessage(1, -57.0), "b": RssMessage(1, -60.0)}),
        ("energy", {"gains": {"a": 3.0}}, {"a": EnergyMessage(1, 30.0), "b": EnergyMessage(1, 10.0)}),
    ],
)
def test_trackers_get_readings_as_if_all_sensors_were_alike(
    kind: str, options: dict[str, Any], messages: dict[str, Any]
) -> None:
    bank = Bank(
        trackers=("ekf",),
        sensors=[("a", 0.0, 0.0), ("b", 10.0, 0.0), ("c", 0.0, 10.0)],
        step_ns=NS,
        seed=1,
        sensing={kind: {"kind": kind, "options": options}},
    )
    (readings,) = bank._reports(1, messages).readings
    assert readings.values[0] == pytest.approx(readings.values[1])


def test_a_field_with_offsets_that_are_known_is_tracked_as_one_without() -> None:
    """Every reading that trackers get is the same, but for rounding of reports; reports themselves are not."""
    offsets = {f"n{i:03d}": 10.0 * (-1) ** i for i in range(25)}
    rows = [simulate(planned(tf.Scenario.load("zhai-spcpf", {**BASE, **own})))[1] for own in ({}, _set(offsets))]
    tracks = [np.array([row.point.mean for row in some]) for some in rows]
    assert len(tracks[0]) == 12
    assert np.abs(tracks[0] - tracks[1]).max() < 0.1


def _set(offsets: Mapping[str, float]) -> dict[str, Any]:
    return {"sensor.offsets": offsets}


def test_a_node_is_told_of_its_own_alone() -> None:
    site = survey(tf.Scenario.load("zhai-spcpf", {**BASE, **_set({"n001": 2.0, "n004": -1.0})}))
    told = [site.sensor(i).to_plain() for i in (1, 2)]
    assert [plain["options"]["offsets"] for plain in told] == [{"n001": 2.0}, {}]
    assert told == json.loads(json.dumps(told))
    for i, plain in zip((1, 2), told, strict=True):
        again, own = Placed.from_plain(plain), site.sensor(i)
        times = range(0, 12 * NS, NS)
        assert [again.sample(t) for t in times] == [own.sample(t) for t in times]


def test_kinds_are_told_apart_by_their_tables() -> None:
    options = {"offsets": {"b": 1.0, "a": 2.0}, "exponent": 2.0}
    same = {"exponent": 2.0, "offsets": {"a": 2.0, "b": 1.0}}
    assert hashable(options) == hashable(same)
    assert known_kind("rss", options) is known_kind("rss", same)
    assert known_kind("rss", options) is not known_kind("rss", {**options, "offsets": {"a": 2.0}})
    assert own_options(options, "a") == {"offsets": {"a": 2.0}, "exponent": 2.0}
    assert own_options({"exponent": 2.0}, "a") == {"exponent": 2.0}


def test_a_scenario_keeps_its_tables() -> None:
    scenario = tf.Scenario.load("zhai-spcpf", {**BASE, **_set({"n004": -1, "n001": 2.0})})
    assert scenario.sensor.options["offsets"] == {"n001": 2.0, "n004": -1.0}
    assert scenario.sensor.model_dump()["offsets"] == {"n001": 2.0, "n004": -1.0}
    assert hash(scenario) == hash(tf.Scenario.load("zhai-spcpf", {**BASE, **_set({"n001": 2.0, "n004": -1.0})}))
    one = tf.Scenario.load("zhai-spcpf", {**BASE, "sensor.offsets.n001": 3.0})
    assert one.sensor.options["offsets"] == {"n001": 3.0}


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"n01": 1.0}, "sensor.offsets: 'n01' is no sensor of the field; did you mean n0"),
        ({"x": 1.0}, "sensor.offsets: 'x' is no sensor of the field; expected ids of the field, like n000"),
        ({"n001": "x"}, "sensor.offsets.n001: is 'x'; expected a number from -100 to 100"),
        ({"n001": 101.0}, "sensor.offsets.n001: is 101.0; expected a number from -100 to 100"),
        ({"n001": True}, "sensor.offsets.n001: is True; expected a number from -100 to 100"),
        ({"a b": 1.0}, "sensor.offsets: has the key 'a b'; expected ids of sensors: 1 to 32 characters"),
        ([1.0], "sensor.offsets: is [1.0]; expected a table by sensor, like { n001 = 1.5 }, of numbers from -100"),
    ],
)
def test_offsets_that_no_field_has(settings: Any, says: str) -> None:
    with pytest.raises(tf.ScenarioError) as caught:
        survey(tf.Scenario.load("zhai-spcpf", {**BASE, "sensor.offsets": settings}))
    assert str(caught.value).startswith(says)


def test_a_gain_is_above_0_and_of_a_sensor_of_the_field() -> None:
    for gains, says in (({"n001": 0.0}, "sensor.gains.n001: is 0.0; expected"), ({"m1": 2.0}, "sensor.gains: 'm1' is")):
        with pytest.raises(tf.ScenarioError) as caught:
            survey(tf.Scenario.load("zhai-spcpf", {**BASE, "sensor.kind": "energy", "sensor.gains": gains}))
        assert says in str(caught.value)


@dataclass(frozen=True)
class Scaled(Ranger):
    """A user's kind, whose sensors have scales of their own."""

    scales: Mapping[str, float] = field(default_factory=dict)

    def biased(self, values: Numbers, id: str) -> Numbers:
        return (values[0] * self.scales.get(id, 1.0), values[1])

    def corrected(self, values: Numbers, id: str) -> Numbers:
        return (values[0] / self.scales.get(id, 1.0), values[1])


@dataclass(frozen=True)
class Wrong(Ranger):
    def corrected(self, values: Numbers, id: str) -> Any:
        return values[:1]


def test_a_users_kind_has_them_too() -> None:
    with registered(scaled=Scaled, wrong=Wrong):
        settings = {**BASE, "sensor.kind": "scaled", "sensor.scales": {"n003": 2.0}}
        site = survey(tf.Scenario.load("zhai-spcpf", settings))
        assert site.sensor(3).to_plain()["options"] == {"scales": {"n003": 2.0}}
        assert site.sensor(2).to_plain()["options"] == {"scales": {}}
        assert simulate(planned(tf.Scenario.load("zhai-spcpf", settings)))[1]
        with pytest.raises(tf.ScenarioError, match=r"sensor.scales: is 2.0; expected a table by sensor, each a number"):
            survey(tf.Scenario.load("zhai-spcpf", {**BASE, "sensor.kind": "scaled", "sensor.scales": 2.0}))
        with pytest.raises(tf.ScenarioError, match=r"sensor.scales: 'm' is no sensor of the field"):
            survey(tf.Scenario.load("zhai-spcpf", {**BASE, "sensor.kind": "scaled", "sensor.scales": {"m": 2.0}}))
        with pytest.raises(tf.ScenarioError, match=r"sensor 'wrong': corrected: returned .* expected 2 numbers"):
            planned(tf.Scenario.load("zhai-spcpf", {**BASE, "sensor.kind": "wrong"}))


# --- missing ----------------------------------------------------------------------------------------------------------

DRAWS: Final = 4000


def heard(share: float, id: str = "n001", incarnation: int = 0) -> list[bool]:
    kind = Kind("rss", Rss(missing=share))
    return [placed(kind, id, incarnation).sample(t * NS) is not None for t in range(DRAWS)]


def test_a_share_is_missing_independently() -> None:
    """Each of these fails with the probability SURE if the code is right."""
    found = {key: np.array(heard(0.3, *key)) for key in (("n001", 0), ("n001", 1), ("n002", 0))}
    for one in found.values():
        assert one.mean() == pytest.approx(0.7, abs=norm.isf(SURE) * (0.21 / DRAWS) ** 0.5)
    a, b, c = found.values()
    for pair in ((a, b), (a, c), (a[1:], a[:-1])):
        assert abs(np.corrcoef(*pair)[0, 1]) < norm.isf(SURE) / DRAWS**0.5
    assert heard(0.3) == heard(0.3)


def test_what_is_there_is_as_it_was() -> None:
    whole, part = placed(Kind("rss", Rss())), placed(Kind("rss", Rss(missing=0.4)))
    both = [(whole.sample(t * NS), part.sample(t * NS)) for t in range(50)]
    assert {part == whole for whole, part in both if part is not None} == {True}
    assert 0 < sum(part is None for _, part in both) < 50
    assert not any(placed(Kind("rss", Rss(missing=1.0))).sample(t * NS) for t in range(50))


def test_a_recorded_sensor_misses_nothing_more() -> None:
    kind = Kind("rss", Rss(missing=0.9), recorded=True)
    played = tuple((t * NS, (-50.0,)) for t in range(50))
    for times in (False, True):
        one = replace(placed(kind), played=played, times=times)
        assert all(one.sample(t * NS) for t in range(50))


def test_missing_is_a_share() -> None:
    with pytest.raises(tf.ScenarioError, match=r"sensor.missing: is 1.5; expected a number from 0 to 1"):
        tf.Scenario.load("zhai-spcpf", {**BASE, "sensor.missing": 1.5})
    with registered(odd=Odd), pytest.raises(tf.ScenarioError, match=r"sensor.missing: 'odd' has 'x'; expected a share"):
        make_sensor("odd", {})


@dataclass(frozen=True)
class Odd(Ranger):
    missing: Any = "x"
