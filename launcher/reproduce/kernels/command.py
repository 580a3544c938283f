"""``trackfield reproduce PAPER --kernels``: a paper's filters alone, its tables and figures, and which claims hold.

Without ``--kernels`` the same is done of a paper whose experiments with roles are beside those on bare filters.
"""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path
from typing import Final

import typer
from rich.text import Text

from launcher import INTERRUPTED
from launcher.record.journal import write_json
from launcher.reproduce.command import FIGURES, Study
from launcher.reproduce.kernels.study import Found, Kernels, done
from launcher.reproduce.papers import kernels_named
from launcher.reproduce.report import written
from launcher.show import console
from launcher.study import store
from launcher.study.store import study_folder
from trackfield.errors import ScenarioError

REPRODUCE: Final = Path(__file__).parents[1]


def reproduce_kernels(name: str, runs: int, out: Path | None, *, roles: bool = False) -> Study:
    """Do all runs of a paper's bare filters, and write report.md, results.json and figures below ``out``.

    With ``roles`` also those of roles that are beside them. Nothing is kept of a study that is interrupted. Raises
    ``ScenarioError`` for an unknown paper or one without such experiments, for less than one run, and for a folder with
    other contents; ``typer.Exit`` with 130 when it is interrupted.
    """
    kernels = kernels_named(name)
    if runs < 1:
        raise ScenarioError(f"is {runs}", key="--runs", expected="1 or more")
    folder = out or Path("runs") / f"reproduce-{kernels.name}{'' if roles else '-kernels'}"
    study_folder(folder, "reproduce-kernels")
    experiments = kernels.experiments_of(roles=roles)
    bare = len(kernels.experiments_of(roles=False))
    told = f"{bare} experiments on bare filters" + (f", {len(experiments) - bare} with roles" if roles else "")
    console.print(Text(f"{kernels.title}: {told}, {runs} runs of each"))
    try:
        return _conclude(kernels, folder, Found(runs, done(experiments, runs), kernels.times()))
    except KeyboardInterrupt:
        console.print("[yellow]interrupted[/]: nothing is kept; the same command begins again")
        raise typer.Exit(INTERRUPTED) from None


def _conclude(kernels: Kernels, folder: Path, found: Found) -> Study:
    claims = kernels.claims(found)
    summary = {
        "paper": kernels.name,
        "command": sys.argv,
        "code": code_digest(),
        "runs": found.runs,
        "times": {name: min(some) for name, some in found.times.items()},
        "tables": {name: [asdict(row) for row in rows] for name, rows in kernels.tables(found).items()},
        "claims": [asdict(claim) for claim in claims],
    }
    report = written(claims, kernels.parts(found), kernels.figures)
    figures = folder / FIGURES
    figures.mkdir(exist_ok=True)
    kernels.draw(figures, found)
    write_json(summary, folder / "results.json")
    (folder / "report.md").write_text(report, encoding="utf-8")
    console.print(Text(f"study: {folder} (report.md, results.json, figures)"))
    return Study(summary, report)


def code_digest() -> str:
    """The digest of every source file that affects the figures of bare filters."""
    return store.code_digest(*sorted(REPRODUCE.rglob("*.py")))
