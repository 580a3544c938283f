"""``trackfield reproduce``: a paper's runs, its tables and figures, and which of its claims hold."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import typer
from rich.text import Text

from launcher import INTERRUPTED
from launcher.record.journal import write_json
from launcher.reproduce.files import write_run, write_tables
from launcher.reproduce.paper import Paper
from launcher.reproduce.papers import paper_named
from launcher.reproduce.report import markdown
from launcher.reproduce.scores import Field, Results, S
from launcher.reproduce.store import Store, code_digest
from launcher.reproduce.timing import cpu_times
from launcher.show import console
from launcher.study.store import study_folder
from trackfield.errors import ScenarioError

FIGURES: Final = "figures"


@dataclass(frozen=True)
class Study:
    """A finished study: the contents of results.json and report.md."""

    summary: Mapping[str, Any]
    report: str

    def shown(self, *, as_json: bool) -> str:
        """What goes to stdout."""
        return json.dumps(self.summary, indent=2) + "\n" if as_json else self.report


def reproduce(name: str, runs: int, out: Path | None) -> Study:
    """Run a paper's study, or what is missing of it, and write tables, figures and one run below ``out``.

    Raises ``ScenarioError`` for an unknown paper, for less than one run, and for a folder with other contents;
    ``typer.Exit`` with 130 when it is interrupted.
    """
    paper = paper_named(name)
    if runs < 1:
        raise ScenarioError(f"is {runs}", key="--runs", expected="1 or more")
    folder = out or Path("runs") / f"reproduce-{paper.name}"
    study_folder(folder, "reproduce")
    store, seeds = Store(folder, list(paper.cases.values())), range(1, runs + 1)
    console.print(Text(f"{paper.title}: {len(paper.cases)} cases, {runs} runs of each"))
    try:
        _fill(store, seeds)
        return _conclude(paper, store, seeds)
    except KeyboardInterrupt:
        left, of = len(store.missing(seeds)), runs * len(paper.cases)
        console.print(f"[yellow]interrupted[/]: {left} of {of} runs are left; the same command runs them")
        raise typer.Exit(INTERRUPTED) from None


def _fill(store: Store, seeds: Sequence[int]) -> None:
    missing = store.missing(seeds)
    there = len(seeds) * len(store.cases) - len(missing)
    if there:
        console.print(f"{there} of {there + len(missing)} runs exist already")
    for _ in store.fill(missing):
        pass


def _conclude(paper: Paper[S], store: Store, seeds: Sequence[int]) -> Study:
    records = {name: store.records(name, seeds) for name in paper.cases}
    goes = cpu_times(paper.timed) if paper.timed else {}
    results = Results(
        len(seeds),
        {name: paper.scores(paper.cases[name], some) for name, some in records.items()},
        {name: Field.of(some) for name, some in records.items()},
        {name: min(some) for name, some in goes.items()},
        paper.contrasts(records, goes),
    )
    summary = {
        "paper": paper.name,
        "command": sys.argv,
        "code": code_digest(),
        **results.plain(),
        "tables": {name: [asdict(row) for row in rows] for name, rows in paper.tables(results).items()},
        "claims": [asdict(claim) for claim in paper.claims(results)],
    }
    report = markdown(paper, results)
    write_tables(store.folder, paper.cases, records)
    figures = store.folder / FIGURES
    figures.mkdir(exist_ok=True)
    typical = paper.draw(figures, records, results)
    run = write_run(store.folder, paper.run, typical[paper.run.name])
    write_json(summary, store.folder / "results.json")
    (store.folder / "report.md").write_text(report, encoding="utf-8")
    folder = str(store.folder)
    console.print(Text(f"study: {folder} (report.md, results.json, figures)\nnext: trackfield view {run}"))
    return Study(summary, report)
