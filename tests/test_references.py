"""Whom the processes of a run ask for the time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pytest

from launcher.plan.architectures import ARCHITECTURES, Arranged, Field
from launcher.plan.architectures.centralised import Centralised
from launcher.plan.prepare import load, planned
from launcher.plan.references import check_references
from trackfield.errors import ScenarioError

OFF = ["link.model=ideal", "clock.offset_ms=50"]


def test_all_sensors_ask_the_centre() -> None:
    centre, *others = planned(load("spcpf", settings=OFF)).processes
    assert (centre.id, centre.config.get("sync"), centre.clock) == ("fusion", None, {})
    assert {process.config["sync"]["reference"] for process in others} == {"fusion"}
    assert all(process.clock for process in others)


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
    check_references(references, "architecture")


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
        check_references(references, "architecture")
    assert what in str(caught.value)


class Circle(Centralised):
    """A sensor asks another one, and that one the first."""

    def arrange(self, field: Field) -> Arranged:
        arranged = super().arrange(field)
        asks = {"n000": "n001", "n001": "n000"}
        return replace(arranged, processes=[replace(p, asks=asks.get(p.id, p.asks)) for p in arranged.processes])


def test_a_plan_with_a_circle_is_refused_even_if_clocks_are_right(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ARCHITECTURES.own, "centralised", Circle)
    for settings in (OFF, OFF[:1]):
        with pytest.raises(ScenarioError, match="n000 asks n001 asks n000 for the time"):
            planned(load("spcpf", settings=settings))
