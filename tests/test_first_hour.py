"""docs/first-hour.md: from a clone to a sweep of one's own field, in fifteen commands that work as they are printed."""

from __future__ import annotations

import csv
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from tests.test_view import with_driver

ROOT: Final = Path(__file__).parents[1]
DOCUMENT: Final = (ROOT / "docs" / "first-hour.md").read_text()
COMMANDS: Final = [line for block in re.findall(r"```sh\n(.*?)```", DOCUMENT, re.DOTALL) for line in block.splitlines()]
FILES: Final = dict(re.findall(r"```(?:csv|toml) (\S+)\n(.*?)```", DOCUMENT, re.DOTALL))
OWN: Final = next(i for i, command in enumerate(COMMANDS) if command.startswith("trackfield run hall"))
"""The first command about what real sensors reported."""
PNG: Final = b"\x89PNG"


def called(command: str, home: Path) -> subprocess.CompletedProcess[str]:
    """A command of the document, called there."""
    program, *arguments = shlex.split(command)
    assert program == "trackfield"
    return subprocess.run(
        [sys.executable, "-m", "launcher.cli", *arguments],
        cwd=home,
        env={**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        timeout=500,
        check=False,
    )


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the document's files, and the run that ``make demo`` leaves: the same one, in virtual time."""
    home = tmp_path_factory.mktemp("hour")
    for name, text in FILES.items():
        (home / name).write_text(text)
    assert "run bus\n" in (ROOT / "Makefile").read_text()
    assert called("trackfield run bus --virtual --quiet", home).returncode == 0
    return home


def test_there_are_fifteen_commands_and_the_first_set_all_up() -> None:
    assert len(COMMANDS) == 15
    assert COMMANDS[1:3] == ["make demo", ". .venv/bin/activate"]
    assert FILES.keys() == {"track.csv", "plan.toml"}


@with_driver
def test_the_demo_can_be_looked_at(home: Path) -> None:
    said = called(COMMANDS[3], home)
    assert said.returncode == 0, said.stderr
    assert (home / "demo.png").read_bytes().startswith(PNG)


def test_a_field_of_ones_own_is_run_broken_compared_and_swept(home: Path) -> None:
    said = {}
    for command in COMMANDS[4:OWN]:
        done = called(command, home)
        assert done.returncode == 0, f"{command}\n{done.stderr}"
        said[command.split()[1]] = done.stdout + done.stderr
    assert (home / "mine.toml").is_file()
    assert "valid" in said["validate"]
    assert "faults" in said["compare"]
    assert "Trackfield comparison" in (home / "compare.html").read_text()
    sweep = home / "sweep"
    assert (sweep / "plots" / "field.spacing_m.png").read_bytes().startswith(PNG)
    assert "with 95 % confidence intervals" in said["study"]
    assert "field.spacing_m=80" in said["study"]  # it was warned of
    for figures in (r"RMSE \[m\] +│ +1\.7\d │ +2\.[34]", r"RMSE \[m\] +│ +3\.0\d │ +5\.[89]"):
        assert re.search(figures, said["compare"])  # from 1.7 to 2.4 m, from 3.0 to 5.9 m
    assert_as_the_document_says(sweep / "summary.csv")


def test_what_real_sensors_reported_is_played_and_calibrated(home: Path) -> None:
    for command in COMMANDS[OWN:-1]:
        done = called(command, home)
        assert done.returncode == 0, f"{command}\n{done.stderr}"
    assert 'kind = "rss"' in (home / "rss.toml").read_text()


def test_a_field_is_planned_with_what_it_gave(home: Path) -> None:
    done = called(COMMANDS[-1], home)
    assert done.returncode == 0, done.stderr
    with (home / "places" / "summary.csv").open(newline="") as file:
        rows = {row["field.spacing_m"]: row for row in csv.DictReader(file)}
    assert [rows[spacing]["tracked_with_gaps"] for spacing in ("4.5", "9")] == ["1", "8"]
    assert [rows[spacing]["lost"] for spacing in ("4.5", "9")] == ["0", "0"]
    assert [round(float(rows[spacing]["rmse.position"]), 1) for spacing in ("4.5", "9")] == [1.6, 3.4]


def assert_as_the_document_says(summary: Path) -> None:
    """Of both trackers up to 60 m, of energy and error, and of 80 m."""
    with summary.open(newline="") as file:
        rows = {(row["field.spacing_m"], row["tracker"]): row for row in csv.DictReader(file)}
    trackers = ("imm-ukf", "spcpf")
    assert rows.keys() == {(spacing, name) for spacing in ("40", "50", "60", "80") for name in trackers}
    assert {float(row["tracked.share"]) for (spacing, _), row in rows.items() if spacing != "80"} == {1.0}
    assert (rows["80", "spcpf"]["tracked_with_gaps"], rows["80", "spcpf"]["runs"]) == ("3", "5")
    energy = {spacing: round(float(rows[spacing, "spcpf"]["energy_j.total"])) for spacing in ("40", "60")}
    assert energy == {"40": 173, "60": 75}
    assert {f"{spent} J" in DOCUMENT for spent in energy.values()} == {True}
    error = {place: float(row["rmse.position"]) for place, row in rows.items()}
    assert (round(error["40", "imm-ukf"], 1), round(error["60", "imm-ukf"], 1)) == (1.3, 2.8)
    for name in trackers:
        assert 1.8 < error["60", name] / error["40", name] < 2.3
        assert error["80", name] / error["40", name] > 5.0
