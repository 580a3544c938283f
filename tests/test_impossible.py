"""Readings that no target gives, wherever it is: nobody tracks with them, and they are counted."""

from __future__ import annotations

from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import Any

import pytest

import trackfield as tf
from launcher.plan.forecast.played import played_in_part
from launcher.plan.prepare import planned
from launcher.record.metrics import run_metrics
from tests.played import OPTIONS, STEP_S, home, ran, recorded, scenario
from tests.rangers import Ranger
from tests.sensing import registered
from trackfield.sensing.kinds import make_sensor
from trackfield.sensing.sensing import IMPOSSIBLE_SD, Numbers
from trackfield.world.scene import Still

__all__ = ["home"]

RSS = {"level_dbm": -60.0, "exponent": 2.0, "shadow_sd_db": 5.0, "floor_m": 0.1}


@pytest.mark.parametrize(
    ("kind", "options", "last", "first"),
    [
        ("rss", RSS, -40.0 + 30.0, -9.9),  # 20 dB more at 0.1 m than at 1 m
        ("range", {"floor_sd_m": 0.5, "growth_m": 0.02}, -3.0, -3.1),
        ("energy", {"noise": 2.0}, -12.0, -12.1),
    ],
)
def test_beyond_six_standard_deviations_it_is_impossible(
    kind: str, options: dict[str, Any], last: float, first: float
) -> None:
    sensor = make_sensor(kind, options)
    assert sensor.possible((last,))
    assert not sensor.possible((first,))
    assert not sensor.possible((nan,))


@pytest.mark.parametrize("kind", OPTIONS)
@pytest.mark.parametrize("away_m", [0.0, 0.05, 1.0, 30.0])
def test_what_a_kind_reads_itself_is_possible(kind: str, away_m: float) -> None:
    sensor = make_sensor(kind, OPTIONS[kind])
    for size in (-IMPOSSIBLE_SD, 0.0, IMPOSSIBLE_SD):
        values = sensor.simulate(Still((away_m, 0.0, 0.0, 0.0)), 0, (0.0, 0.0), (size,) * sensor.n)
        assert values is not None
        assert sensor.possible(values)


def test_an_offset_is_taken_off_before() -> None:
    sensor = make_sensor("rss", {**RSS, "offsets": {"a": 50.0}})
    assert sensor.possible(sensor.corrected((30.0,), "a"))
    assert not sensor.possible(sensor.corrected((30.0,), "b"))


def test_trackers_are_not_given_them(home: Path) -> None:
    """The tracks are those of a field whose sensor did not report then."""
    rows = recorded("range", {}).splitlines(keepends=True)
    at = next(i for i, row in enumerate(rows) if row.startswith(f"{10 * STEP_S + 0.01:g},b,"))
    t_s, id, _, x, y = rows[at].split(",")
    Path("reports.csv").write_text("".join([*rows[:at], f"{t_s},{id},-80,{x},{y}", *rows[at + 1 :]]))
    plan, ledger, tracks = ran(scenario())
    assert run_metrics(plan, ledger, tracks)["frames"]["ignored"] == 1
    assert list(played_in_part(plan)) == [
        "1 recorded report is impossible, and trackers are not given such: -80 m of b",
    ]
    Path("reports.csv").write_text("".join([*rows[:at], *rows[at + 1 :]]))
    _, _, without = ran(scenario())
    assert [row.point for row in tracks] == [row.point for row in without]


def test_many_are_told_in_one_sentence(home: Path) -> None:
    lines = recorded("range", {}).splitlines(keepends=True)
    wrong = [",".join([*row.split(",")[:2], "-80", *row.split(",")[3:]]) if ",b," in row else row for row in lines]
    Path("reports.csv").write_text("".join(wrong))
    (told,) = played_in_part(planned(scenario()))
    assert told.startswith("30 recorded reports are impossible, and trackers are not given such: -80 m of b, -80")
    assert told.endswith(" and 25 more")


@dataclass(frozen=True)
class Near(Ranger):
    """A user's kind that knows what it cannot read."""

    def possible(self, values: Numbers) -> bool:
        return values[0] < 1e6


@dataclass(frozen=True)
class Vague(Ranger):
    def possible(self, values: Numbers) -> Any:
        return "perhaps"


def test_a_users_kind_says_it_by_itself() -> None:
    with registered(near=Near, vague=Vague):
        assert not make_sensor("near", {}).possible((1e7, 0.0))
        settings = {"field.nodes": 4, "target.steps": 3, "fusion.trackers": ["ekf"]}
        planned(tf.Scenario.load("zhai-spcpf", {**settings, "sensor.kind": "near"}))
        with pytest.raises(tf.ScenarioError, match=r"sensor 'vague': possible: returned 'perhaps'.* True or False"):
            planned(tf.Scenario.load("zhai-spcpf", {**settings, "sensor.kind": "vague"}))
