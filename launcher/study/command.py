"""``trackfield study``: its options, and its output while the runs go on."""

from __future__ import annotations

import os
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import typer
from rich.console import Console
from rich.text import Text

from launcher import INTERRUPTED
from launcher.show import console, note
from launcher.study.axes import Design, design, label, overlap, parse_vary
from launcher.study.figures import pair
from launcher.study.folder import StudyFolder, default_folder, seeds_in_words
from launcher.study.page import PAGE
from launcher.study.pictures.pareto import front_of
from launcher.study.studies import fill, finish
from launcher.study.table import rich_table
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario

MOST_WARNED: Final = 3
_WIDTH: Final = 200
"""Width of the table, in characters, where there is no terminal."""


def conduct(
    scenario: Scenario,
    *,
    seeds: str,
    vary: Sequence[str],
    fixed: Mapping[str, Any],
    pareto: str | None,
    n_jobs: int,
    out: Path | None,
    command: Sequence[str],
) -> None:
    """Run a study, or what is missing of it, and print its table; ``fixed`` are the keys that other options set.

    Raises ``ScenarioError`` for bad input before anything runs, ``typer.Exit`` with 130 when it is interrupted.
    """
    varied = parse_vary(vary)
    figures = pair(pareto) if pareto is not None else None
    whole = design(scenario, parse_seeds(seeds), varied)
    _check_free(whole, fixed)
    folder = StudyFolder(out or default_folder(whole), whole)
    for remark in folder.begin(command):
        note(remark)
    missing, runs = len(folder.missing()), len(whole.jobs)
    console.print(Text(_announced(whole)))
    for warning in _warnings(whole):
        console.print(Text.assemble(("warning: ", "yellow"), warning))
    if missing < runs:
        console.print(f"{runs - missing} of {runs} runs exist already")
    try:
        fill(folder, n_jobs, lines=True)
        found = finish(folder, figures)
    except KeyboardInterrupt:
        console.print(Text(f"interrupted: {_done(folder)}"))
        raise typer.Exit(INTERRUPTED) from None
    stdout = _table_console()
    stdout.print(rich_table(found.summary, stdout))
    if figures and (empty := front_of(found.summary, *figures).empty):
        note(f"there is no Pareto front: {empty}")
    console.print(Text(f"study: {folder.path} ({PAGE}, summary.csv, study.csv, plots)"))
    console.print(Text(f"next: open {folder.path / PAGE}"))


def parse_seeds(text: str) -> Sequence[int]:
    """``N`` as 1 to N, ``A-B`` as A to B, ``A,B,...`` one by one. Raises ``ScenarioError`` for any other text."""
    expected = "how many, like 20 (seeds 1 to 20), or from-to, like 21-40, or some, like 3,7,9"
    try:
        if "," in text:
            return [int(part) for part in text.split(",")]
        first, dash, last = text.partition("-")
        found = range(int(first), int(last) + 1) if dash else range(1, int(text) + 1)
    except ValueError:
        raise ScenarioError(f"is {text!r}", key="--seeds", expected=expected) from None
    if not found:
        raise ScenarioError(f"{text!r} gives no seeds", key="--seeds", expected=expected)
    return found


def _done(folder: StudyFolder) -> str:
    """What there is of a study that is interrupted, and what the same command would do."""
    left, runs = len(folder.missing()), len(folder.design.jobs)
    if not left:
        return f"all {runs} runs are done and kept in {folder.path}; the same command writes the page"
    return f"{runs - left} of {runs} runs are done and kept in {folder.path}; the same command runs the others"


def _check_free(whole: Design, fixed: Collection[str]) -> None:
    """Raise ``ScenarioError`` if another option sets what the study sets itself."""
    if "seed" in fixed:
        raise ScenarioError("has no effect beside --seeds", file="--set", key="seed", expected="--seeds alone")
    for axis in whole.axes:
        for key in fixed:
            if overlap(axis.sets, key):
                what = f"is varied, and set by another option ({key})"
                raise ScenarioError(what, file="--vary", key=axis.key, expected="one of the two")


def _announced(whole: Design) -> str:
    axes = "; ".join(f"{axis.key} = {', '.join(map(label, axis.values))}" for axis in whole.axes)
    combinations = f"{len(whole.variants)} combinations ({axes}), " if whole.axes else ""
    return f"{whole.scenario.name}: {combinations}seeds {seeds_in_words(whole.seeds)}: {len(whole.jobs)} runs"


def _warnings(whole: Design) -> Iterator[str]:
    """The first few warnings, and the combinations that have them."""
    found: dict[str, list[str]] = {}
    for variant in whole.variants:
        for warning in variant.warnings:
            found.setdefault(warning, []).append(variant.name)
    for warning, (first, *others) in list(found.items())[:MOST_WARNED]:
        more = f" and {len(others)} more" if others else ""
        yield f"with {first}{more}: {warning}" if first else warning
    if len(found) > MOST_WARNED:
        doubtful = sum(bool(variant.warnings) for variant in whole.variants)
        yield f"{doubtful} of the {len(whole.variants)} combinations have warnings"


def _table_console() -> Console:
    """Stdout; if it is not a terminal, wide enough for the whole table."""
    wide = None if sys.stdout.isatty() or os.environ.get("COLUMNS") else _WIDTH
    return Console(markup=False, emoji=False, highlight=False, width=wide)
