"""``report.html``: one file with all results of a run, which opens without any other file."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from launcher.files import CAMERA, CONTAINERS, MANIFEST, MESSAGES_TABLE, SCENARIO, TRACKS_TABLE
from launcher.record.outside.filmed import VIDEO
from launcher.record.words import alarms, span
from launcher.report.cells import ids, number
from launcher.report.figures import PLOTS, draw
from launcher.report.folder import Run, read_run
from launcher.report.leading import peers
from launcher.report.outages import few_reports
from launcher.report.parts import PARTS, camera, clusters, passes
from launcher.report.templates import inline, templates
from trackfield.errors import ScenarioError

PAGE: Final = "report.html"
_SECTIONS: Final = {
    "result": "Result",
    "track": "Track",
    "error": "Error",
    "consistency": "Consistency",
    "clusters": "Clusters",
    "heads": "Heads",
    "passes": "Passes",
    "camera": "Camera",
    "messages": "Messages",
    "channel": "The channel",
    "latency": "Latency",
    "energy": "Energy",
    "faults": "Faults and failures",
    "machine": "The machine",
    "again": "Run it again",
}
_FILES: Final = {
    SCENARIO: "the scenario as it ran, every default written out",
    "metrics.json": "all figures of this page, and more",
    TRACKS_TABLE: "estimates of each tracker at each step, and the truth; for pandas, DuckDB and others",
    MESSAGES_TABLE: "every frame and what became of it",
    CAMERA: "what camera, camera control, gateway, video and system control told",
    VIDEO: "what the camera saw",
    "run.rrd": "the timeline, for trackfield view",
    MANIFEST: "command, versions, machine",
    PLOTS: "the figures of this page",
    CONTAINERS: "what was done to containers, as planned, and when",
    "logs": "the log of each process",
}


def write_report(folder: Path) -> Path:
    """Draw ``plots/*.png`` and write ``report.html`` into the folder of a finished run, again if they exist.

    Returns the path of the page. Raises ``ScenarioError`` for a folder that is not that of a finished run, or cannot be
    written.
    """
    run = read_run(folder)
    try:
        return write_page(run, draw(run))
    except OSError as error:
        what, where = f"cannot write there ({error.strerror})", str(error.filename or folder)
        raise ScenarioError(what, file=where, expected="a writable folder") from None


def write_page(run: Run, pictures: Mapping[str, Path]) -> Path:
    """Write ``report.html`` with these figures, by name; its path."""
    text = templates().get_template("report.html.j2").render(_contents(run, pictures))
    page = run.folder / PAGE
    page.write_text(text, encoding="utf-8")
    return page


def _contents(run: Run, pictures: Mapping[str, Path]) -> dict[str, Any]:
    """The values of the template: the contents of each part by its name, and the rest."""
    shown = {
        "consistency": "nees" in pictures,
        "clusters": clusters.shown(run),
        "heads": peers(run),
        "passes": passes.shown(run),
        "camera": run.outside is not None,
        "channel": run.metrics["channel"]["use_mean"] is not None,
        "energy": bool(run.metrics["energy_j"]["total"]),
    }
    files = {name: file.read_bytes() for name, file in pictures.items()}
    if (sheet := camera.sheet(run)) is not None:
        files["sheet"] = sheet
    return {
        "run": run,
        "alarms": [*alarms(run.metrics), *_shortfalls(run)],
        **{name: part.contents(run) for name, part in PARTS.items()},
        "sections": [(id, name) for id, name in _SECTIONS.items() if shown.get(id, True)],
        "number": number,
        "span": span,
        "pictures": {name: inline(data) for name, data in files.items()},
        "commands": commands(run),
        "files": {name: what for name, what in _FILES.items() if _has(run.folder / name)},
    }


def _shortfalls(run: Run) -> list[str]:
    """What a reader must know before any figure."""
    found = []
    said = "" if run.metrics["complete"] else f" ({run.metrics['end_reason']})"
    if run.ended_early:
        planned, last, ended_s = run.site.steps, run.last_step, run.metrics["ended_s"]
        found.append(f"the run ended early, {ended_s:.1f} s after its first step{said}: {last} of {planned} steps")
    elif said:
        found.append(f"not all of the run was recorded{said}")
    if reason := few_reports(run):
        found.append(reason)
    found += run.metrics["recorder"]["complaints"]
    if lost := run.metrics["frames"]["host_lost"]:
        found.append(f"{lost} frames were lost by the machine itself (frames.host_lost)")
    if dropped := run.metrics["recorder"]["dropped"]:
        found.append(f"{dropped} frames never reached the recorder (recorder.dropped): the tables lack them")
    died = run.metrics["processes"]["died"]
    if died is None:
        found.append("which processes died is not known")
    if died:
        found.append(f"died unplanned: {ids(one['id'] for one in died)}")
    return found


def commands(run: Run) -> list[tuple[str, str]]:
    """How to run it again, and what else can be done with it: (command, what it does)."""
    name = shlex.quote(run.folder.resolve().name)
    virtual = " --virtual" if run.metrics["driver"] == "virtual" else ""
    speed = run.metrics["timing"]["speed"]
    pace = "" if speed in (None, 1) else f" --speed {speed:g}"
    given = run.manifest.command[1:]
    replayed = run.metrics["driver"] == "replay"
    again = [
        (f"trackfield run {name}/scenario.toml{virtual}{pace} --out again", "the same run from its folder"),
        (f"trackfield compare {name} again --exact 0", "check that it is the same, bit for bit"),
    ]
    return [
        *([(" ".join(["trackfield", *map(_quoted, given)]), "the command of this run")] if given else []),
        *([] if replayed or run.ended_early else again),
        (f"trackfield view {name}", "its timeline"),
        (f"trackfield report {name}", "this page, written again"),
    ]


def _quoted(argument: str) -> str:
    """Quoted for a shell, in the way that is easier to read."""
    double = "'" in argument and not set(argument) & set('"$`\\!')
    return f'"{argument}"' if double else shlex.quote(argument)


def _has(path: Path) -> bool:
    return any(path.iterdir()) if path.is_dir() else path.exists()
