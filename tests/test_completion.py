"""Completion in a real bash, by the script that ``trackfield --show-completion`` prints."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.test_latest import folders
from trackfield.filters.trackers import TRACKERS
from trackfield.scenario import names

ROOT = Path(__file__).parents[1]
ASK = """
eval "$(_TRACKFIELD_COMPLETE=source_bash trackfield)"
while read -r -a COMP_WORDS; do
    case "${COMP_WORDS[-1]}" in _) COMP_WORDS[-1]="" ;; esac
    COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
    COMPREPLY=()
    _trackfield_completion trackfield
    echo "${COMPREPLY[*]}"
done
"""


@pytest.fixture
def home(tmp_path: Path) -> Path:
    """A working directory with two finished runs, and the program beside it."""
    program = tmp_path / "bin" / "trackfield"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nPYTHONPATH="{ROOT}" exec "{sys.executable}" -m launcher.cli "$@"\n')
    program.chmod(0o755)
    folders(tmp_path, old="2026-05-01T10:00:00+00:00", young="2026-05-02T10:00:00+00:00")
    return tmp_path


def completions(home: Path, *lines: str) -> list[list[str]]:
    """What bash offers for the last word of each line; ``_`` stands for one not yet begun."""
    environment = {**os.environ, "PATH": f"{home / 'bin'}:{os.environ['PATH']}"}
    asked = "".join(f"{line}\n" for line in lines)
    said = subprocess.run(
        ["bash", "-c", ASK],
        check=False,
        input=asked,
        env=environment,
        cwd=home,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert (said.returncode, said.stderr) == (0, "")
    return [line.split() for line in said.stdout.splitlines()]


def test_bash_completes_commands_and_what_can_be_chosen(home: Path) -> None:
    commands, scenarios, links, trackers, keys, runs, kinds, files = completions(
        home,
        "trackfield re",
        "trackfield run _",
        "trackfield run bus --link g",
        "trackfield run bus --tracker fix",
        "trackfield run bus --set link.loss",
        "trackfield compare latest _",
        "trackfield list li",
        "trackfield run ./",
    )
    assert commands == ["report", "replay", "recover", "reproduce"]
    assert scenarios == list(names())
    assert links == ["gilbert_elliott"]
    assert trackers == [name for name in TRACKERS if name.startswith("fix")]
    assert keys == ["link.loss=", "link.loss_good=", "link.loss_bad="]
    assert runs == ["latest", "latest~1", "runs/young", "runs/old"]
    assert kinds == ["links"]
    assert files == []  # then bash offers files by itself
