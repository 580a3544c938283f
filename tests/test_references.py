"""Whom the processes of a run ask for the time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pytest

from launcher.plan.architectures import ARCHITECTURES, Arranged
from launcher.plan.architectures.centralised import Centralised
from launcher.plan.prepare import load, planned
from launcher.plan.references import check_references, references_of
from trackfield.drivers.spec import ProcessSpec
from trackfield.errors import ScenarioError

OFF = ["link.model=ideal", "clock.offset_ms=50"]


def test_all_sensors_ask_the_centre() -> None:
    centre, *others = references_of(planned(load("spcpf", settings=OFF)).processes).items()
    assert centre == ("fusion", None)
    assert {reference for _, reference in others} == {"fusion"}


@pytest.mark.parametrize(
    "references",
    [
        {},
        {"a": None},
        {"a": None, "b": None},
        {"c": "b", "b": "a", "a": None, "d": "b"},
        {f"n{i:04}": f"n{i + 1:04}" if i < 4999 else None for i in range(5000)},
    ],
)
def test_trees_of_any_depth_are_right(references: Mapping[str, str | None]) -> None:
    check_references(references)


@pytest.mark.parametrize(
    ("references", "what"),
    [
        ({"a": "a"}, "architecture: a asks a for the time, so none of them ever learns it; expected references that"),
        ({"r": None, "a": "b", "b": "a", "c": "r"}, "a asks b asks a for the time"),
        ({"r": None, "x": "a", "a": "b", "b": "c", "c": "a"}, "architecture: a asks b asks c asks a for the time"),
        ({"a": None, "b": "head"}, "architecture: b asks 'head' for the time, which is not there"),
    ],
)
def test_circles_and_strangers_are_refused(references: Mapping[str, str | None], what: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        check_references(references)
    assert what in str(caught.value)


def test_a_role_of_ones_own_may_mean_something_else_by_sync() -> None:
    configs = ({"sync": True}, {"sync": {"every": 5}}, {"sync": None}, {})
    processes = [ProcessSpec(f"p{i}", "own", "a:b", config) for i, config in enumerate(configs)]
    assert set(references_of(processes).values()) == {None}


class Circle(Centralised):
    """A sensor asks another one, and that one the first."""

    def arrange(self, end_ns: int) -> Arranged:
        arranged = super().arrange(end_ns)
        asks = {"n000": "n001", "n001": "n000"}
        processes = tuple(
            replace(p, config={**p.config, "sync": {**p.config["sync"], "reference": asks[p.id]}})
            if p.id in asks
            else p
            for p in arranged.processes
        )
        return replace(arranged, processes=processes)


def test_a_plan_with_a_circle_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ARCHITECTURES, "centralised", Circle)
    with pytest.raises(ScenarioError, match="n000 asks n001 asks n000 for the time"):
        planned(load("spcpf", settings=OFF))
