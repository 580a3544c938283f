"""The page of a comparison: one file in the style of a run's report, which opens without any other file."""

from __future__ import annotations

import io
import shlex
from collections.abc import Sequence
from typing import Any

from launcher.colours import tracker_colours
from launcher.report.cells import Table
from launcher.report.folder import Run, read_run
from launcher.report.parts.setting import HOW
from launcher.study.comparison.exact import Exactness
from launcher.study.comparison.remarks import remarks
from launcher.study.comparison.rows import figures, settings
from launcher.study.comparison.runs import Compared


def as_page(compared: Compared, exact: Exactness | None = None) -> str:
    """The text of the page. Raises ``ScenarioError`` for a folder whose report could not be written either."""
    from launcher.report.templates import templates

    return templates(__package__).get_template("comparison.html.j2").render(_contents(compared, exact))


def as_table(compared: Compared) -> str:
    """What differs and the figures, as a piece of HTML for a notebook."""
    from launcher.report.templates import templates

    groups = [settings(compared), *figures(compared)]
    page = templates(__package__).get_template("table.html.j2")
    return page.render(compared=compared, groups=[group for group in groups if group.rows], colours=_colours(compared))


def _contents(compared: Compared, exact: Exactness | None) -> dict[str, Any]:
    from launcher.study.comparison.lines import MOST_RUNS, drawable, lines
    from launcher.study.comparison.paired import paired

    runs = [read_run(folder) for folder in compared.folders]
    found = lines(runs, compared.names)
    groups = [[line for line in found if line.place in group] for group in compared.groups]
    return {
        "compared": compared,
        "facts": _facts(compared, runs),
        "remarks": remarks(compared),
        "exact": exact,
        "verdicts": _verdicts(compared, runs),
        "colours": _colours(compared),
        "settings": settings(compared),
        "figures": figures(compared),
        "paired": [table for group in groups if (table := paired(group)).rows],
        "left_out": compared.names[MOST_RUNS:],
        "commands": _commands(compared),
        "version": runs[0].manifest.versions.get("trackfield", ""),
        **_pictures(compared, runs, [drawable(group) for group in groups]),
    }


def _pictures(compared: Compared, runs: Sequence[Run], groups: Sequence[Sequence[Any]]) -> dict[str, Any]:
    """All figures, drawn: those of one kind by its name, and the maps."""
    import matplotlib

    from launcher.report.style import STYLE
    from launcher.report.templates import inline
    from launcher.study.comparison import figures as draw
    from launcher.study.comparison.maps import maps

    found = [line for group in groups for line in group]
    with matplotlib.rc_context():
        matplotlib.rcParams.update(STYLE)
        drawn = {
            "error": draw.errors(found),
            "distribution": draw.distribution(found),
            "fates": draw.fates(runs, compared.names),
            "energy": draw.spent(runs, compared.names),
        }
        fields = [field for group in groups for field in maps(group)]
        return {
            "pictures": {name: inline(_png(figure)) for name, figure in drawn.items() if figure is not None},
            "maps": [(inline(_png(field.figure)), field.text) for field in fields],
        }


def _png(figure: Any) -> bytes:
    file = io.BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue()


def _colours(compared: Compared) -> dict[str, str]:
    return tracker_colours(compared.trackers)


def _facts(compared: Compared, runs: Sequence[Run]) -> Table:
    """What each run was: a row each."""
    rows = [
        [
            name,
            run.scenario.name,
            str(run.metrics["seed"]),
            HOW[run.metrics["driver"]],
            f"{length:g} s",
            f"{len(run.site.sensors):,}",
            run.scenario.link.model,
            run.manifest.when,
        ]
        for name, run, length in zip(compared.names, runs, compared.lengths_s, strict=True)
    ]
    return Table(["run", "scenario", "seed", "driver", "length", "sensors", "link", "started"], rows)


def _verdicts(compared: Compared, runs: Sequence[Run]) -> dict[str, list[tuple[str, Any]]]:
    """(name of the run, verdict) of each tracker, for each run that has it."""
    from launcher.report.parts.verdicts import verdicts

    found: dict[str, list[tuple[str, Any]]] = {}
    for name, run in zip(compared.names, runs, strict=True):
        for verdict in verdicts(run):
            found.setdefault(verdict.tracker, []).append((name, verdict))
    return found


def _commands(compared: Compared) -> list[tuple[str, str]]:
    """Commands for the next steps: (command, what it does)."""
    folders = " ".join(shlex.quote(str(folder)) for folder in compared.folders)
    return [
        (f"trackfield compare {folders}", "the table of this page"),
        (f"trackfield compare {folders} --rrd both.rrd", "tracks and errors on one timeline, for trackfield view"),
        (f"trackfield compare {folders} --exact 0", "check that tracks and frames are the same"),
        *((f"trackfield report {shlex.quote(str(folder))}", "the report of this run") for folder in compared.folders),
    ]
