"""A warning of processes that answer each other faster than a machine brings their messages, and of nobody else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any, Final

import pytest

import trackfield as tf
from launcher.plan.architectures import ARCHITECTURES
from launcher.plan.forecast.answers import HOST_S, Answers, answers
from launcher.plan.prepare import planned, warned
from launcher.records import Plan
from tests.command_line import Call, trackfield
from tests.pairs import Paired
from tests.protocols.relay import Station
from tests.strangers import Heralded, Merged
from trackfield.scenario import names

__all__ = ["trackfield"]

SMALL = {"field.nodes": 9, "target.steps": 3, "architecture.kind": "own"}
Line = Mapping[str, Sequence[str]]
"""Who sends whom items, and is told that they came."""


@dataclass(frozen=True)
class Relayed:
    """The usual field, and a relay beside it along this line; its stations acknowledge what they get if ``taken``."""

    line: Line
    taken: bool = True

    def arrange(self, field: tf.Field) -> tf.Arranged:
        x, y = field.centre
        ids = [id for id, *_ in field.sensors]
        sends: dict[str, dict[str, list[str]]] = {id: {} for id in chain(self.line, *self.line.values())}
        for src, dsts in self.line.items():
            sends[src]["parcel"] = list(dsts)
            for dst in dsts if self.taken else ():
                sends[dst].setdefault("taken", []).append(src)
        config: dict[str, Any] = {"number": 0, "before": "", "after": ""}
        stations = [
            tf.Process(id, "station", x, y, Station, {"name": id, **config}, sends=kinds) for id, kinds in sends.items()
        ]
        centre = field.fusion_centre("fusion", x, y, ids)
        return tf.Arranged([centre, *field.sensor_nodes("fusion"), *stations], {"base": ["fusion"]})


@pytest.fixture(autouse=True)
def registry() -> Iterator[None]:
    """What a test registers is gone after it."""
    yield
    ARCHITECTURES.registered.clear()


def plan_of(maker: Any, settings: Mapping[str, Any], speed: float = 1.0) -> Plan:
    tf.register_architecture("own", maker)
    return planned(tf.Scenario.load("zhai-spcpf", {**SMALL, **settings}), speed)


CHAIN = {"source": ["r1"], "r1": ["r2"], "r2": ["sink"]}


def restless(plan: Plan) -> list[str]:
    return [text for text in warned(plan).warnings if "answer each other" in text]


@pytest.mark.parametrize(
    ("delay_ms", "speed", "warns"),
    [
        (8.1, 1.0, False),
        (7.9, 1.0, True),
        (100.0, 1.0, False),
        (40.0, 5.0, False),
        (39.0, 5.0, True),
        (2.0, 0.2, False),
    ],
)
def test_it_is_the_wall_time_of_an_answer_that_counts(delay_ms: float, speed: float, warns: bool) -> None:
    link: dict[str, Any] = {"link.model": "fixed", "link.delay_ms": delay_ms}
    plan = plan_of(lambda: Relayed(CHAIN), link, speed)
    found = answers(plan)
    assert found is not None
    assert found.delay_s == pytest.approx(delay_ms / 1000)
    assert bool(restless(plan)) == warns == (delay_ms / 1000 / speed < HOST_S)


def test_the_warning_says_what_would_help(trackfield: Call) -> None:
    tf.register_architecture("own", lambda: Relayed(CHAIN))
    settings = {**SMALL, "link.model": "fixed", "link.delay_ms": 6}
    words = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
    said = trackfield("validate", "zhai-spcpf", *words, "--speed", "3")
    assert said.code == 0
    assert (
        "warning: processes answer each other (parcel, taken) within 6 ms, 2 ms of wall time at --speed 3, and a busy "
        "machine takes up to 8 ms to bring a frame: over processes the run may lag more and more (timing.lag_ms); use "
        "--speed 0.75 or less, or a link with a longer delay; --virtual needs neither\n"
    ) in said.err
    assert "answer each other" not in trackfield("validate", "zhai-spcpf", *words, "--speed", "0.75").err


def test_a_delay_that_is_drawn_counts_by_its_median() -> None:
    link: dict[str, Any] = {"link.model": "gilbert_elliott", "link.delay_ms": 1.0, "link.jitter_ms": 20.0}
    found = answers(plan_of(lambda: Relayed(CHAIN), link))
    assert found is not None
    assert found.kinds == ("parcel", "taken")
    assert 0.010 < found.delay_s < 0.020  # 1 ms and 20 ms * ln 2, of up to 400 frames: 15 ms, sd 1 ms


def test_on_a_link_that_carries_nothing_nobody_answers() -> None:
    assert answers(plan_of(lambda: Relayed(CHAIN), {"link.model": "fixed", "link.loss": 1.0})) is None


# --- who answers whom -------------------------------------------------------------------------------------------------

SILENT: dict[str, Any] = {
    "what is only sent on": lambda: Relayed(CHAIN, taken=False),
    "a tree": lambda: Relayed({"a": ["c"], "b": ["c"], "c": ["d"], "d": ["e", "f"]}, taken=False),
    "a herald": Heralded,
    "merged tracks": Merged,
    "a node with a centre": Paired,
}
CIRCLES: dict[str, tuple[Any, tuple[str, ...]]] = {
    "acknowledged": (lambda: Relayed({"a": ["b"]}), ("parcel", "taken")),
    "a ring": (lambda: Relayed({"a": ["b"], "b": ["c"], "c": ["a"]}, taken=False), ("parcel",)),
    "a ring with a tail": (lambda: Relayed({"a": ["b"], "b": ["a", "c"], "c": ["d"]}, taken=False), ("parcel",)),
}


@pytest.mark.parametrize("name", SILENT)
def test_what_goes_on_and_never_comes_back_is_no_answer(name: str) -> None:
    plan = plan_of(SILENT[name], {"clock.offset_ms": 10, "sensor.threshold": "adaptive"}, 100.0)
    assert answers(plan) is None
    assert restless(plan) == []


@pytest.mark.parametrize("name", CIRCLES)
def test_what_goes_round_is(name: str) -> None:
    maker, kinds = CIRCLES[name]
    assert answers(plan_of(maker, {"link.model": "ideal"})) == Answers(kinds, 0.001)


LED: Final = frozenset({"ozfidan-clusters", "yang-ecpa", "yu-mrbpf", "zhou-upf"})
"""Fields of processes that lead each other."""


@pytest.mark.parametrize("name", [name for name in names() if name not in LED])
def test_no_packaged_field_answers_itself_but_those_that_are_led(name: str) -> None:
    plan = planned(tf.Scenario.load(name, {"target.steps": 3}), 100.0)
    assert answers(plan) is None


@pytest.mark.parametrize("name", ["yu-mrbpf", "zhou-upf"])
def test_nodes_that_may_lead_answer_each_other_within_milliseconds(name: str) -> None:
    """Claims, polls and hand-overs are followed by other messages at once: over processes some are taken back."""
    found = answers(planned(tf.Scenario.load(name, {"target.steps": 3}), 100.0))
    assert found is not None
    assert {"claim", "poll", "hand-over"} <= set(found.kinds)
    assert found.delay_s == pytest.approx(0.004, abs=0.001)


def test_nodes_that_hear_answer_each_other_within_milliseconds() -> None:
    """Data is acknowledged and handed on at once."""
    found = answers(planned(tf.Scenario.load("yang-ecpa", {"target.steps": 60, "camera.kind": "none"}), 100.0))
    assert found is not None
    assert {"data", "data-ack", "reinforce"} <= set(found.kinds)
    assert found.delay_s == pytest.approx(0.0016, abs=0.0005)


def test_masters_answer_each_other_slowly_enough_for_five_times_the_speed() -> None:
    """A request to join and its answer are on the air for 108 ms."""
    plan = planned(tf.Scenario.load("ozfidan-clusters", {"target.steps": 3}), 5.0)
    found = answers(plan)
    assert found is not None
    assert found.delay_s == pytest.approx(0.108, abs=0.001)
    assert restless(plan) == []
