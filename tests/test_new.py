"""``trackfield new``: a scenario file of one's own, to start from."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.command_line import Call, trackfield
from trackfield.scenario import Scenario, names
from trackfield.scenario.keys import sections_of_file

__all__ = ["trackfield"]

TWO = """
name = "two"
[[targets]]
id = "one"
path = "waypoints"
waypoints = [[0, 0, 0], [9, 90, 0]]
[[targets]]
id = "other"
path = "waypoints"
waypoints = [[0, 0, 50], [9, 90, 50]]
[[faults]]
kind = "kill"
share = 0.1
at_s = 3
[[faults]]
kind = "partition"
share = 0.1
at_s = 3
until_s = 5
"""


@pytest.mark.parametrize("name", names())
def test_it_is_the_scenario_that_it_starts_from(trackfield: Call, tmp_path: Path, name: str) -> None:
    said = trackfield("new", "mine.toml", "--from", name)
    assert (said.code, said.out) == (0, "")
    assert said.err.startswith("wrote mine.toml\n")
    assert trackfield("validate", "mine.toml").code == 0
    mine, theirs = Scenario.load(tmp_path / "mine.toml").plain(), Scenario.load(name).plain()
    assert mine.pop("name") == "mine"
    theirs.pop("name")
    files = (("target", "file", "target"), ("field", "file", "sensors"), ("sensor", "recording", "recording"))
    for section, key, called in files:
        if key in theirs[section]:
            copy, original = (Path(one[section].pop(key)) for one in (mine, theirs))
            assert copy == tmp_path / f"mine-{called}{original.suffix}"
            assert copy.read_bytes() == original.read_bytes()
            assert f"wrote {copy.name}\n" in said.err
    assert mine == theirs


def test_it_names_the_commands_that_follow(trackfield: Call) -> None:
    *_, check, run, study = trackfield("new", "my-field.toml").err.splitlines()
    assert check.endswith("validate my-field.toml")
    assert run.endswith("run my-field.toml --virtual")
    assert study.endswith("study my-field.toml --seeds 10")


def test_every_key_is_there_with_its_meaning_set_or_not(trackfield: Call, tmp_path: Path) -> None:
    trackfield("new", "mine.toml")
    text = (tmp_path / "mine.toml").read_text()
    for section, kind in (("link", "lognormal_prr"), ("field", "grid"), ("energy", ""), ("fusion", "")):
        lines = re.split(r"^\[", text, flags=re.M)
        (own,) = (part for part in lines if part.startswith(f"{section}]"))
        for key in sections_of_file()[section].kinds[kind].values():
            assert re.search(rf"^(# )?{key.name} = .*# {re.escape(key.meaning)}", own, re.M), key.name
    assert "trackfield list links" in text


def test_a_key_set_by_hand_is_taken(trackfield: Call, tmp_path: Path) -> None:
    trackfield("new", "mine.toml")
    file = tmp_path / "mine.toml"
    file.write_text(re.sub(r"# range_m = \.\.\. ", "range_m = 300.0", file.read_text()))
    assert Scenario.load(file).link.range_m == 300.0


def test_each_of_many_targets_and_faults_has_the_keys_of_its_own_kind(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "two.toml").write_text(TWO)
    assert trackfield("new", "mine.toml", "--from", "two.toml").code == 0
    text = (tmp_path / "mine.toml").read_text()
    parts = re.findall(r"^\[\[(targets|faults)\]\]\n((?:[^\n]+\n)+)", text, re.M)
    found = [(section, set(re.findall(r"^(?:# )?([a-z_]+) = ", part, re.M))) for section, part in parts]
    kinds = [("targets", "waypoints"), ("targets", "waypoints"), ("faults", "kill"), ("faults", "partition")]
    assert found == [(section, set(sections_of_file()[section].kinds[kind])) for section, kind in kinds]


def test_nothing_is_overwritten(trackfield: Call, tmp_path: Path) -> None:
    for name in ("mine.toml", "other-target.gpx"):
        (tmp_path / name).write_text("precious")
    for file, there in (("mine.toml", "mine.toml"), ("other.toml", "other-target.gpx")):
        said = trackfield("new", file, "--from", "bus")
        assert said.code == 2
        assert f"{there}: FILE: exists already; expected a new file" in said.err
    assert {file.name for file in tmp_path.iterdir()} == {"mine.toml", "other-target.gpx"}
    assert {file.read_text() for file in tmp_path.iterdir()} == {"precious"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("mine",), "mine: FILE: does not end in .toml; expected mine.toml"),
        (("my field.toml",), 'name: is "my field"; expected up to 100 letters, digits, and _ . - between them'),
        (("nowhere/mine.toml",), "nowhere/mine.toml: FILE: cannot be written (No such file or directory)"),
        (("mine.toml", "--from", "buss"), "unknown scenario 'buss'; did you mean bus?"),
    ],
)
def test_what_cannot_be_is_told(trackfield: Call, tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    said = trackfield("new", *arguments)
    assert said.code == 2
    assert message in said.err
    assert list(tmp_path.iterdir()) == []
