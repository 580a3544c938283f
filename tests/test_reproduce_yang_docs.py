"""What docs/papers-yang.md says of the experiments of Yang et al. (2009) is in ``results.json`` beside it."""

from __future__ import annotations

import json
from typing import Any, Final

from launcher.reproduce.papers.yang import words
from launcher.reproduce.papers.yang.camera import tables as camera
from launcher.reproduce.papers.yang.claims import JUDGES
from launcher.reproduce.papers.yang.whole import tables
from launcher.reproduce.tables import READING
from tests.yang_page import FIGURES, KEPT, PAGE, claims, parts, written

SAID: Final = PAGE.read_text()
RESULTS: Final[dict[str, Any]] = json.loads((KEPT / "results.json").read_text())
OTHERS: Final = 8
"""Claims about sound, whole runs and the camera."""


def test_claims_and_verdicts_are_those_of_the_results() -> None:
    assert len(RESULTS["claims"]) == len(JUDGES) + OTHERS
    assert f"{READING}\n\n{claims(RESULTS)}\n" in SAID


def test_tables_are_those_of_the_results() -> None:
    found = parts(RESULTS)
    assert set(found) == {*words.TITLES.values(), *tables.TITLES.values(), *camera.TITLES.values()}
    for title, text in found.items():
        assert f"### {title}\n\n{text}\n" in SAID, title


def test_writing_the_page_again_changes_nothing() -> None:
    assert written(SAID, RESULTS) == SAID


def test_every_figure_is_there_and_shown() -> None:
    for name in FIGURES:
        assert (KEPT / f"{name}.png").exists()
        assert f"(papers-yang/{name}.png)" in SAID


def test_the_command_is_that_of_the_results() -> None:
    assert f"\n{' '.join(RESULTS['command'])}\n" in SAID
    assert RESULTS["command"][-2:] == ["--runs", str(RESULTS["runs"])]
    assert RESULTS["runs"] >= 500
