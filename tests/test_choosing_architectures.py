"""What makes docs/architectures.md: its parts are studies that can be run, and its tables say what a choice says."""

from __future__ import annotations

import shlex
from dataclasses import replace
from pathlib import Path

import pytest

from launcher.plan.prepare import changes
from launcher.study.axes import overlap, parse_vary
from launcher.study.settings.choice import Cell, Choice, Line, Table
from tests.architectures import PARTS, Part, Refused, designed, marks, named, put, renamed, toml, written
from trackfield.errors import ScenarioError
from trackfield.filters.trackers import TRACKERS
from trackfield.scenario import Scenario
from trackfield.scenario.architectures.centralised import Centralised
from trackfield.scenario.architectures.clusters import Clusters
from trackfield.scenario.architectures.cpa import Cpa
from trackfield.scenario.architectures.peers import PeersSection
from trackfield.scenario.sensors.own import OwnSensor

PAGE = Path("docs/architectures.md")


def _line(title: str, said: str, won: bool) -> Line:
    best = Cell("1.50", "1.00 to 2.00", "", "won" if won else "open")
    return Line(title, "less", (best, Cell("2.00", "1.00 to 3.00", "+0.10 to +0.90", "" if won else "open")), said)


def _choice(*titles: str) -> Choice:
    lines = (_line("RMSE at the base [m]", "b", True), _line("peak channel use", "not separated: b, a|c", False))
    tables = tuple(Table(title, lines, "b, a|c", "b" if title else "") for title in titles)
    powers = (("asleep", (("1.0", "2.0"), ("3.0", "4.0"))),)
    return Choice("?", "ekf", ("b", "a|c"), tables, 0, (), powers, ("links",), (), (("b", "none"),), ("RMSE",), "")


PART = Part("p", "bus", ("target.steps=6",), ("architecture.kind=b,a",), 3)


def test_a_table_has_each_figure_with_its_interval_and_a_winner_only_where_one_is_named() -> None:
    lines = list(written(PART, _choice(""), [Refused("c", "link: is\n  bad")]))
    assert "    trackfield study bus --seeds 3 --set target.steps=6 --vary architecture.kind=b,a" in lines
    assert "Refused: c: `link: is bad`." in lines
    assert r"| figure | b | a\|c | best |" in lines
    assert "| RMSE at the base [m] | **1.50** [1.00, 2.00] | 2.00 [1.00, 3.00]; Δ +0.10 to +0.90 | b |" in lines
    assert "| peak channel use | 1.50 [1.00, 2.00] | 2.00 [1.00, 3.00]; Δ +0.10 to +0.90 | none |" in lines
    assert "| asleep | 1.0 / 2.0 | 3.0 / 4.0 |" in lines
    assert "On the Pareto front of RMSE: **b, a|c**." in lines


def test_few_seeds_name_nobody_and_some_that_are_open_are_named() -> None:
    few = list(written(PART, replace(_choice(""), level="Too few."), []))
    assert all(line.endswith(" |  |") for line in few if line.startswith(("| RMSE", "| peak")))
    assert "Too few." in few
    three = _line("peak channel use", "not separated: b, a|c", won=False)
    three = replace(three, cells=(*three.cells, Cell("9.00", "", "+5 to +6", "")))
    choice = replace(_choice(""), settings=("b", "a", "d"), tables=(Table("", (three,), "b", ""),))
    assert any(line.endswith("| none of b, a |") for line in written(PART, choice, []))


def test_conditions_have_rows_of_the_figures_asked_for_alone() -> None:
    lines = list(written(replace(PART, figures=("RMSE at the base",)), _choice("x=1", "x=2"), []))
    assert [line for line in lines if line.startswith("| RMSE")] == [
        f"| RMSE at the base [m] | `x={x}` | **1.50** | 2.00 | b |" for x in (1, 2)
    ]
    assert not any(line.startswith("| peak") for line in lines)
    assert "- `x=2`: b, a|c" in lines
    assert "x=2: b lost the target at the base in half of the runs or more." in lines


def test_settings_that_are_tables_are_named_by_their_kind() -> None:
    assert named("architecture", {"kind": "clusters", "masters": 44}) == "clusters (masters=44)"
    assert named("architecture", {"kind": "clusters"}) == named("architecture.kind", "clusters") == "clusters"
    text = '{"kind": "clusters", "masters": 44}'
    choice = replace(_choice(""), settings=("b", text), tables=(Table("", (), f"b, {text}", text),))
    found = renamed(choice, {"b": "other", text: "clusters (masters=44)"})
    assert found.settings == ("b", "clusters (masters=44)")
    assert (found.tables[0].front, found.tables[0].lost) == ("b, clusters (masters=44)", "clusters (masters=44)")


@pytest.mark.parametrize("part", PARTS.values(), ids=PARTS)
def test_the_command_of_each_part_says_the_study_that_is_run(part: Part) -> None:
    words = shlex.split(part.command)
    assert words[:3] == ["trackfield", "study", part.scenario]
    assert tuple(words[i + 1] for i, word in enumerate(words) if word == "--set") == part.settings
    assert tuple(words[i + 1] for i, word in enumerate(words) if word == "--vary") == part.vary
    keys = changes(part.scenario, settings=part.settings)
    assert not any(overlap(varied, key) for varied in parse_vary(part.vary) for key in keys)  # the command refuses that


@pytest.mark.parametrize("part", PARTS.values(), ids=PARTS)
def test_each_value_of_each_key_is_valid(part: Part) -> None:
    """Of keys that are varied together only the first values are, which is enough for their names and forms."""
    scenario, varied = part.loaded(), parse_vary(part.vary)
    first = {key: values[0] for key, values in varied.items()}
    for key, values in varied.items():
        assert len(values) > 1
        for value in values:
            found = Scenario.load(scenario.set_all({**first, key: value}).plain(), known_trackers=TRACKERS)
            assert isinstance(
                found.architecture, Centralised | Clusters | Cpa | PeersSection
            )  # others may be users' own
            assert not isinstance(found.sensor, OwnSensor)
        assert parse_vary([f"{key}={','.join(map(toml, values))}"]) == {key: values}


def test_what_is_refused_is_left_out_and_told() -> None:
    """A centre that nobody reaches in one hop."""
    vary = ("architecture={kind='centralised'},{kind='clusters',masters=1},{kind='clusters',masters=2}",)
    radio = "link={model='lognormal_prr',radio='802154-0dbm',range_m=5}"
    part = replace(PART, settings=("target.steps=6", radio), vary=vary)
    with pytest.raises(ScenarioError):
        designed(part)  # all are refused
    capacity = "architecture={kind='centralised'},{kind='clusters'},{kind='clusters',masters=1000}"
    left, whole, refused = designed(replace(PART, vary=(capacity,)))
    assert [one.setting for one in refused] == ["clusters (masters=1000)"]
    assert refused[0].said
    assert left.vary == ("architecture={kind='centralised'},{kind='clusters'}",)
    assert len(whole.variants) == 2


def test_tables_go_between_their_marks_and_the_text_around_stands() -> None:
    begin, end = marks("p")
    page = f"before\n{begin}\nold\n{end}\nafter\n"
    found = put(page, "p", ["", "| new |", ""])
    assert found == f"before\n{begin}\n\n| new |\n\n{end}\nafter\n"
    assert put(found, "p", ["", "| new |", ""]) == found
    with pytest.raises(ValueError, match="the page has no"):
        put(page, "q", [])


def test_the_page_has_a_place_for_each_part() -> None:
    page = PAGE.read_text(encoding="utf-8")
    for name in PARTS:
        put(page, name, [])
