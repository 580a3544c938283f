"""The report of a run in virtual time: drawn beside it, and the same as one that is drawn afterwards."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from tests.command_line import Call, trackfield

__all__ = ["trackfield"]

SHORT = ("run", "zhai-spcpf", "--virtual", "--set", "target.steps=8", "--out", "mine")


def contents(folder: Path) -> dict[str, bytes]:
    """What belongs to the report of a run folder."""
    return {file.name: file.read_bytes() for file in (folder / "report.html", *(folder / "plots").iterdir())}


@pytest.mark.rendered
def test_a_report_drawn_beside_the_run_is_the_one_drawn_afterwards(trackfield: Call, tmp_path: Path) -> None:
    said = trackfield(*SHORT)
    assert said.code == 0, said.err
    beside = contents(tmp_path / "mine")
    assert len(beside) > 5
    for file in (tmp_path / "mine" / "plots").iterdir():
        file.unlink()
    assert trackfield("report", "mine").code == 0
    assert contents(tmp_path / "mine") == beside


def test_on_one_core_the_report_is_drawn_by_the_program_itself(
    trackfield: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {0}, raising=False)
    monkeypatch.setattr(os, "fork", lambda: pytest.fail("one core has no room for another process"))
    assert trackfield(*SHORT).code == 0
    assert len(contents(tmp_path / "mine")) > 5


def test_a_run_without_report_says_why_and_is_none_the_worse(
    trackfield: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError("no room left")

    monkeypatch.setattr("launcher.report.page.write_page", fail)  # the process that draws is forked with it
    said = trackfield(*SHORT)
    assert said.code == 0
    assert "no report: OSError: no room left" in said.err
    assert "report.html" not in said.err
    assert (tmp_path / "mine" / "metrics.json").is_file()
    assert not (tmp_path / "mine" / "report.html").exists()
