"""Any number that a scenario can hold: refused by one error, or planned within bounds of time and memory."""

from __future__ import annotations

import random
import re
import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import psutil
import pytest

from launcher.plan.architectures import ARCHITECTURES
from launcher.plan.prepare import checked, planned, warned
from tests.criers import Crying
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario
from trackfield.scenario.keys import Kinds, sections_of_file
from trackfield.scenario.scenario import schema

SOUND = {"enum", "const", "pattern"}
EXTREMES: tuple[Any, ...] = (
    *(sign * value for sign in (1, -1) for value in (0.0, 5e-324, 1e-308, 1e-10, 1e-9, 1e-6, 0.001, 0.5, 1, 10.0)),
    *(sign * value for sign in (1, -1) for value in (1000, 65536, 1e6, 1e7, 1e9, 2**31, 2**53, 1e18, 1e154, 1e308)),
    *(2**63 - 1, -(2**63), 2**63, 2**64, 2**20_000, float("inf"), float("-inf"), float("nan"), True, "", "1", [], {}),
)
LONGEST_S, LARGEST = 100, 3 << 30
"""Seconds of the processor, half of which the largest field that is allowed takes, and further bytes."""


def unbounded(about: Any, path: str) -> Iterator[str]:
    """What in a JSON schema has no limits."""
    if isinstance(about, list):
        for number, one in enumerate(about):
            yield from unbounded(one, f"{path}/{number}")
    if not isinstance(about, dict):
        return
    kind = about.get("type") if isinstance(about.get("type"), str) else None
    limits = about.keys()
    if kind in ("number", "integer") and not SOUND & limits:
        low = {"minimum", "exclusiveMinimum"} & limits
        high = {"maximum", "exclusiveMaximum"} & limits
        if not low or not high:
            yield f"{path}: {kind}"
    if kind == "string" and not {*SOUND, "maxLength"} & limits:
        yield f"{path}: {kind}"
    if kind == "array" and "maxItems" not in limits:
        yield f"{path}: {kind}"
    for name, one in about.items():
        if name not in ("default", "examples"):
            yield from unbounded(one, f"{path}/{name}")


def test_every_number_text_and_list_of_a_scenario_has_limits() -> None:
    assert list(unbounded(schema(), "")) == []


def test_what_has_no_limits_is_found() -> None:
    wrong = {"type": "number", "minimum": 0}
    assert list(unbounded({"properties": {"x": wrong}}, "")) == ["/properties/x: number"]


# --- one key at a time ------------------------------------------------------------------------------------------------


def numeric(section: Kinds, kind: str) -> Iterator[str]:
    """The keys of this kind of section that hold numbers, or may."""
    for name, key in section.kinds[kind].items():
        if name != section.tag and not key.expected.startswith(("one of", "true or", "CSV", "GPX")):
            yield name


def cases() -> Iterator[tuple[str, str, str]]:
    """(section, kind, key) of every key."""
    for name, section in sections_of_file().items():
        for kind in section.kinds:
            if kind != "any other":
                yield from ((name, kind, key) for key in numeric(section, kind))


REQUIRED: dict[str, Any] = {
    "nodes": ["n000"],
    "at_s": 2.0,
    "until_s": 4.0,
    "jump_ms": 5.0,
    "bias_db": 1.0,
    "waypoints": [[0, 0, 0], [10, 100, 100]],
    "distance_m": 10.0,
    "file": "none",
}


def scenario(section: str, kind: str, values: dict[str, Any]) -> dict[str, Any]:
    """A small scenario in which a section of this kind has these values."""
    about = sections_of_file()[section]
    needed = {
        key: REQUIRED[key]
        for key in about.kinds[kind]
        if key in REQUIRED and (section, key) not in (("field", "nodes"), ("sensor", "nodes"))
    }
    whole = ({about.tag: kind} if about.tag else {}) | needed | values
    if "role" in values or "share" in values:
        whole.pop("nodes", None)
    base: dict[str, Any] = {
        "name": "extreme",
        "target": {"path": "s1", "steps": 10},
        "field": {"layout": "grid", "extent_m": 200.0},
    }
    if section == "targets":
        whole.setdefault("id", "second")
    if section == "sensors":
        base["fusion"] = {"trackers": ["ekf", "ukf"]}
    if section in ("backbone", "serial"):  # which needs processes that have it
        base["architecture"] = {"kind": "crying", "medium": section}
    if (section, kind) == ("camera", "evi-d30"):  # which needs a gateway
        base["architecture"] = {"kind": "cpa"}
    if (section, kind) in (("architecture", "cpa"), ("camera", "evi-d30")):  # which need such sensors
        base |= {"sensor": {"kind": "cpa"}, "fusion": {"trackers": ["ml"]}}
    return base | {section: [whole] if about.many else whole}


@pytest.fixture(autouse=True)
def crying() -> Iterator[None]:
    ARCHITECTURES.register("crying", Crying)
    yield
    ARCHITECTURES.registered.clear()


@contextmanager
def bounded() -> Iterator[None]:
    """Fails what takes too long, and what allocates too much."""

    def late(*about: object) -> None:
        raise TimeoutError(f"more than {LONGEST_S} s")

    before, limits = signal.signal(signal.SIGPROF, late), resource.getrlimit(resource.RLIMIT_AS)
    signal.setitimer(signal.ITIMER_PROF, LONGEST_S)
    size = psutil.Process().memory_info().vms + LARGEST
    resource.setrlimit(resource.RLIMIT_AS, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limits)
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def refused(data: dict[str, Any]) -> str:
    """The error of a scenario, empty if it can be planned; anything but a ``ScenarioError`` is passed on."""
    try:
        with bounded():
            warned(planned(checked(Scenario.load(data))))
    except ScenarioError as error:
        return str(error)
    return ""


@pytest.mark.parametrize(("section", "kind"), sorted({case[:2] for case in cases()}))
def test_without_an_extreme_value_it_is_planned(section: str, kind: str) -> None:
    if kind not in ("file", "recording", "trace"):  # there is no file
        assert refused(scenario(section, kind, {})) == ""


@pytest.mark.parametrize(("section", "kind", "key"), list(cases()))
def test_an_extreme_value_is_refused_or_planned(section: str, kind: str, key: str) -> None:
    for value in EXTREMES:
        if key != "nodes" or value != 65536:  # a real field, which takes a while
            said = refused(scenario(section, kind, {key: value}))
            assert len(said) < 2000, said


NESTED = {
    "target.waypoints": ("waypoints", [[0.0, 0.0, 0.0], [10.0, 100.0, 100.0], [20.0, 100.0, 0.0]]),
    "fusion.path": (None, [[0.0, 0.0, 0.0], [10.0, 100.0, 100.0]]),
    "fusion.prior_sd": (None, [[20.0, 20.0, 4.0, 4.0]]),
}


@pytest.mark.parametrize("key", NESTED)
def test_an_extreme_number_in_a_list_is_refused_or_planned(key: str) -> None:
    path, lists = NESTED[key]
    section, _, name = key.partition(".")
    for value in EXTREMES:
        for row, numbers in enumerate(lists):
            for column in range(len(numbers)):
                changed = [list(one) for one in lists]
                changed[row][column] = value
                own = {name: changed[0] if name == "prior_sd" else changed}
                data = scenario(section, path or "", own | ({"prior": "paper"} if name == "prior_sd" else {}))
                assert len(refused(data)) < 2000


# --- several at a time ------------------------------------------------------------------------------------------------

LIMITS = re.compile(r"a (whole )?number from (\S+) to (\S+?),?$")


def at_the_limits(draw: random.Random) -> dict[str, Any]:
    """A scenario with a few of its numbers, of any sections, at one of their limits."""
    data: dict[str, Any] = {}
    for section, about in sections_of_file().items():
        kind = draw.choice([kind for kind in about.kinds if kind not in ("any other", "file", "trace")])
        values: dict[str, Any] = {}
        for name, key in about.kinds[kind].items():
            if (found := LIMITS.fullmatch(key.expected)) and draw.random() < 0.1:
                limit = float(found[draw.choice((2, 3))])
                values[name] = int(limit) if found[1] else limit
        if values.get("nodes", 0) > 65536:  # a real field, which takes a while
            del values["nodes"]
        if section == "targets":  # the first target's count
            values = {key: value for key, value in values.items() if key not in ("step_s", "steps")}
        data |= {section: scenario(section, kind, values)[section]}
    return scenario("run", "", {}) | data


@pytest.mark.parametrize("seed", range(60))
def test_several_numbers_at_their_limits_are_refused_or_planned(seed: int) -> None:
    assert len(refused(at_the_limits(random.Random(seed)))) < 2000
