"""``study.html``: one file with all results of a study, which opens without any other file."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from launcher.files import MANIFEST, SCENARIO, TRACKS_TABLE
from launcher.report.templates import inline, templates
from launcher.study.axes import TRACKER, in_words, label
from launcher.study.figures import FIGURES
from launcher.study.folder import CHOSEN, StudyFolder, seeds_in_words
from launcher.study.pictures.drawing import PLOTS, draw, pictured
from launcher.study.pictures.effects import lines
from launcher.study.pictures.pareto import default_pair, front_of
from launcher.study.results import StudyRun, median_run
from launcher.study.settings.choice import choice_of
from launcher.study.store import RESULTS
from launcher.study.summary import Summary
from launcher.study.table import caption, grid

PAGE: Final = "study.html"
_FILES: Final = {
    "summary.csv": "the table of this page: a row for each combination and tracker, with all figures and intervals",
    "study.csv": "a row for each run and tracker",
    "study.parquet": "the same, for pandas, DuckDB and others",
    TRACKS_TABLE: "the tracks of all runs, step by step",
    CHOSEN: "the run with the median RMSE, to look at: trackfield view",
    SCENARIO: "the scenario before any key is varied",
    MANIFEST: "command, versions, machine, seeds and what was varied",
    PLOTS: "the pictures of this page",
    RESULTS: "the runs and the scenario of each combination",
}


def write_page(
    folder: StudyFolder, runs: Sequence[StudyRun], summary: Summary, pareto: tuple[str, str] | None = None
) -> Path:
    """Draw the pictures and write ``study.html`` into the folder, over earlier ones; the path of the page."""
    pictures = draw(summary, folder.path, pareto)
    manifest = json.loads((folder.path / MANIFEST).read_bytes())
    x, y = pareto or default_pair(summary)
    missing = front_of(summary, x, y).empty if pareto else ""
    given = manifest["command"][1:]
    text = (
        templates("launcher.study")
        .get_template("study.html.j2")
        .render(
            name=summary.name,
            facts=_facts(summary, len(runs)),
            choice=choice_of(folder.design, runs),
            grid=grid(summary),
            caption=caption(summary),
            lifetimes=summary.told("lifetime_s.first_death"),
            axes=list(_axes(summary)),
            pictures={name: inline(file.read_bytes()) for name, file in pictures.items()},
            pareto_title=f"Pareto front: {FIGURES[x].name} and {FIGURES[y].name}",
            pareto_said=_front_said(x, y),
            pareto_missing=missing,
            command=shlex.join(["trackfield", *given]) if given else "",
            looks=list(_looks(folder, runs)),
            toml=(folder.path / SCENARIO).read_text(encoding="utf-8"),
            files={name: what for name, what in _FILES.items() if name != CHOSEN or not summary.axes},
            manifest=manifest,
        )
    )
    page = folder.path / PAGE
    page.write_text(text, encoding="utf-8")
    return page


def _facts(summary: Summary, runs: int) -> list[tuple[str, str]]:
    return [
        *((axis.key, ", ".join(map(label, axis.values))) for axis in summary.axes),
        ("seeds", seeds_in_words(summary.seeds)),
        ("runs", f"{runs:,}, in virtual time"),
        *([("trackers", ", ".join(summary.trackers))] if TRACKER not in [axis.key for axis in summary.axes] else []),
    ]


def _axes(summary: Summary) -> Iterator[tuple[str, str, str]]:
    """(key, heading, caption) of each picture of an axis."""
    bars = "Bars: 95 % confidence intervals." if summary.estimated else "Too few seeds for intervals."
    for axis in pictured(summary):
        _, held = lines(summary, axis)
        also = f" Shown for {in_words(held)}; the table has the other combinations." if held else ""
        yield axis.key, f"The effect of {axis.key}", f"Means over the seeds of each combination. {bars}{also}"


def _front_said(x: str, y: str) -> str:
    sides = " and ".join(f"{FIGURES[key].better} {FIGURES[key].name}" for key in (x, y))
    return (
        f"Means of each combination, bars as above; {sides} is better ({x}, {y}). A combination is not "
        "on the front if another is no worse in either and better in one, or if it lost half of its runs or more."
    )


def _looks(folder: StudyFolder, runs: Sequence[StudyRun]) -> Iterator[tuple[str, str]]:
    """(combination, the command that makes its median run again, as a folder with timeline and report)."""
    home = folder.path.absolute().parent
    for place, variant in enumerate(folder.design.variants):
        own = [run for run in runs if run.values == variant.values]
        seed = median_run(own).seed
        file = shlex.quote(str(folder.scenario_file(place).absolute().relative_to(home)))
        yield variant.name or "the scenario", f"trackfield run {file} --virtual --seed {seed}"
