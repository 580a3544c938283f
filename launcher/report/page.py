"""``report.html``: one file with all that a run has to show, which needs nothing else to be opened."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from launcher.record.words import alarms
from launcher.report.cells import ids, number
from launcher.report.figures import PLOTS, draw
from launcher.report.folder import Run, read_run
from launcher.report.parts import PARTS
from launcher.report.templates import inline, templates

PAGE: Final = "report.html"
_HOW: Final = {"processes": "as processes", "virtual": "in virtual time", "replay": "recorded reports, fused again"}
_FILES: Final = {
    "scenario.toml": "the scenario as it ran, every default written out",
    "metrics.json": "all figures of this page, and more",
    "tracks.parquet": "what each tracker said at each step, beside the truth",
    "messages.parquet": "every frame and what became of it",
    "run.rrd": "the timeline, for trackfield view",
    "manifest.json": "command, versions, machine",
    PLOTS: "the figures of this page",
    "logs": "what each process had to say",
}


def write_report(folder: Path) -> Path:
    """Draw ``plots/*.png`` and write ``report.html`` into a finished run folder, anew; the path of the page.

    Raises ``ScenarioError`` for a folder that is no finished run, and ``OSError`` where it cannot be written.
    """
    run = read_run(folder)
    return write_page(run, draw(run))


def write_page(run: Run, pictures: Mapping[str, Path]) -> Path:
    """Write ``report.html`` with these figures, by name; its path."""
    text = templates().get_template("report.html.j2").render(_contents(run, pictures))
    page = run.folder / PAGE
    page.write_text(text, encoding="utf-8")
    return page


def _contents(run: Run, pictures: Mapping[str, Path]) -> dict[str, Any]:
    """What the template is filled with: each part's contents by its name, and what is of no part."""
    return {
        "run": run,
        "facts": _facts(run),
        "alarms": [*alarms(run.metrics), *_shortfalls(run)],
        **{name: part.contents(run) for name, part in PARTS.items()},
        "number": number,
        "pictures": {name: inline(file.read_bytes()) for name, file in pictures.items()},
        "commands": commands(run),
        "files": {name: what for name, what in _FILES.items() if _has(run.folder / name)},
    }


def _facts(run: Run) -> list[tuple[str, str]]:
    """What the run was, at a glance."""
    metrics, scenario = run.metrics, run.scenario
    how = _HOW[metrics["driver"]]
    speed = metrics["timing"]["speed"]
    setup = f", after {run.origin_s:g} s of setup" if run.origin_s else ""
    return [
        ("driver", how if speed in (None, 1) else f"{how}, {speed:g} times as fast"),
        ("seed", str(metrics["seed"])),
        ("started", run.manifest["started"].replace("T", " ").replace("+00:00", " UTC")),
        ("sensors", f"{len(run.site.sensors):,}, {scenario.field.layout}"),
        *([("targets", ids(run.site.paths))] if run.several else []),
        ("steps", f"{run.steps:,} of {run.site.step_ns / 1e9:g} s{setup}"),
        ("link", scenario.link.model),
    ]


def _shortfalls(run: Run) -> list[str]:
    """What a reader must know before all figures."""
    found = []
    if run.steps < run.site.steps:
        found.append(f"the run ended early: {run.steps} of {run.site.steps} steps")
    if lost := run.metrics["frames"]["host_lost"]:
        found.append(f"{lost} frames were lost by the machine itself (frames.host_lost)")
    if dropped := run.metrics["recorder"]["dropped"]:
        found.append(f"{dropped} frames never reached the recorder (recorder.dropped): the tables lack them")
    if died := run.metrics["processes"]["died"]:
        found.append(f"died without being planned: {ids(one['id'] for one in died)}")
    return found


def commands(run: Run) -> list[tuple[str, str]]:
    """How to do it again, and what else can be done with it: (command, what it does)."""
    name = shlex.quote(run.folder.resolve().name)
    virtual = " --virtual" if run.metrics["driver"] == "virtual" else ""
    speed = run.metrics["timing"]["speed"]
    pace = "" if speed in (None, 1) else f" --speed {speed:g}"
    given = run.manifest["command"][1:]
    replayed = run.metrics["driver"] == "replay"
    again = [
        (f"trackfield run {name}/scenario.toml{virtual}{pace} --out again", "the same run from its folder"),
        (f"trackfield compare {name} again --exact 0", "whether it is the same, bit for bit"),
    ]
    return [
        *([(" ".join(["trackfield", *map(_quoted, given)]), "as it was called")] if given else []),
        *([] if replayed else again),
        (f"trackfield view {name}", "its timeline"),
        (f"trackfield report {name}", "this page, anew"),
    ]


def _quoted(argument: str) -> str:
    """As a shell takes it, in the quotes that are easier to read."""
    double = "'" in argument and not set(argument) & set('"$`\\!')
    return f'"{argument}"' if double else shlex.quote(argument)


def _has(path: Path) -> bool:
    return any(path.iterdir()) if path.is_dir() else path.exists()
