"""What ``trackfield list`` says of everything that a scenario can name."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from launcher.commands.kinds import KINDS
from tests.command_line import Call, trackfield
from trackfield.filters.single_model import Ekf
from trackfield.filters.trackers import TRACKERS
from trackfield.link.radios import RADIOS
from trackfield.scenario import names, summary
from trackfield.scenario.keys import sections_of_file
from trackfield.sensing.kinds import SENSORS

__all__ = ["trackfield"]


@dataclass(frozen=True)
class Lagging(Ekf):
    """An EKF that is late by ``steps`` steps.

    For tests.
    """

    steps: int = 3


def described(text: str) -> dict[str, list[str]]:
    """What a list says of each name, line by line."""
    found: dict[str, list[str]] = {}
    name = ""
    for line in text.splitlines():
        if line[0] == " ":
            found[name].append(line.strip())
        else:
            name, _, what = line.partition("  ")
            found[name] = [what.strip()]
    return found


def joined(lines: list[str]) -> str:
    """A list that may take several lines."""
    return " ".join(lines)


def test_without_a_kind_it_tells_the_scenarios_and_names_the_rest(trackfield: Call) -> None:
    said = trackfield("list")
    assert (said.code, said.err) == (0, "")
    scenarios, others, how = said.out.split("\n\n")
    assert described(scenarios) == {name: [summary(name)] for name in names()}
    assert list(described(others)) == [name for name in KINDS if name != "scenarios"]
    assert joined(described(others)["trackers"]) == ", ".join(TRACKERS)
    assert described(others)["links"] == [", ".join(sections_of_file()["link"].kinds)]
    assert "trackfield list KIND" in how


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_says_of_all_its_members_what_they_are(trackfield: Call, kind: str) -> None:
    said = trackfield("list", kind)
    assert (said.code, said.err) == (0, "")
    found = described(said.out)
    scenarios, others, _ = trackfield("list").out.split("\n\n")
    named = {"scenarios": [", ".join(described(scenarios))], **described(others)}
    assert joined(named[kind]) == ", ".join(found)
    for name, (what, *parameters) in found.items():
        assert len(what) > 8, name
        assert "``" not in what
        assert len(parameters) <= 3  # lines; all but the longest lists fit into one


def test_parameters_stand_below_with_their_defaults(trackfield: Call) -> None:
    of_any = "range_m, burst_loss, burst_s, extra_loss"
    assert described(trackfield("list", "links").out)["fixed"][1] == f"{of_any}, loss=0.05, delay_ms=5.0"
    assert described(trackfield("list", "trackers").out)["bootstrap"][1].startswith("n=2000, ")
    assert described(trackfield("list", "radios").out).keys() == RADIOS.keys()
    assert "position_error_m=0.0" in described(trackfield("list", "sensors").out)["doa"][1]


def test_what_users_bring_is_there_too_and_says_where_it_is_from(
    trackfield: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(TRACKERS.registered, "lagging", Lagging)
    monkeypatch.setitem(SENSORS.registered, "sonar", Lagging)
    place = f"{__name__}:Lagging"
    for kind, name in (("trackers", "lagging"), ("sensors", "sonar")):
        found = described(trackfield("list", kind).out)
        assert found[name] == [f"An EKF that is late by steps steps ({place})", "robust=false, steps=3"]


def test_a_package_that_cannot_be_loaded_is_told_and_no_more(trackfield: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    from importlib.metadata import EntryPoint

    broken = EntryPoint("broken", "no_such_module:Tracker", TRACKERS.group)
    monkeypatch.setitem(TRACKERS.__dict__, "_installed", {"broken": broken})
    said = trackfield("list", "trackers")
    assert said.code == 0
    assert described(said.out)["broken"][0].startswith("cannot be loaded from no_such_module:Tracker (")


def test_an_unknown_kind_is_told_with_those_there_are(trackfield: Call) -> None:
    said = trackfield("list", "tracker")
    assert (said.code, said.out) == (2, "")
    assert "unknown kind 'tracker'; did you mean trackers?; expected one of scenarios, trackers, " in said.err
