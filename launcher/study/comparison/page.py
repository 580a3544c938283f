"""The page of a comparison: one file with the look of a run's report, which needs nothing else to be opened."""

from __future__ import annotations

import io
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from launcher.colours import tracker_colours
from launcher.record.verdict import LOST, TRACKED, told
from launcher.report.cells import NOTHING, number
from launcher.report.folder import Run, read_run
from launcher.study.comparison.exact import Exactness
from launcher.study.comparison.remarks import remarks
from launcher.study.comparison.rows import figures, settings
from launcher.study.comparison.runs import Compared

_HOW: Final = {"processes": "as processes", "virtual": "in virtual time", "replay": "recorded reports, fused again"}


@dataclass(frozen=True)
class Verdict:
    """What became of one tracker in one run; ``state`` is good, doubtful or bad."""

    run: str
    said: str
    state: str
    text: str


def as_page(compared: Compared, exact: Exactness | None = None) -> str:
    """The text of the page. Raises ``ScenarioError`` for a folder whose report could not be made either."""
    from launcher.report.templates import templates

    return templates(__package__).get_template("comparison.html.j2").render(_contents(compared, exact))


def as_table(compared: Compared) -> str:
    """What differs and the figures, as a piece of HTML for a notebook."""
    from launcher.report.templates import templates

    groups = [settings(compared), *figures(compared)]
    page = templates(__package__).get_template("table.html.j2")
    return page.render(compared=compared, groups=[group for group in groups if group.rows], colours=_colours(compared))


def _contents(compared: Compared, exact: Exactness | None) -> dict[str, Any]:
    from launcher.study.comparison.lines import MOST_RUNS, lines
    from launcher.study.comparison.paired import paired

    runs = [read_run(folder) for folder in compared.folders]
    found = lines(runs, compared.names)
    groups = [[line for line in found if line.place in group] for group in compared.groups]
    return {
        "compared": compared,
        "facts": _facts(compared, runs),
        "remarks": remarks(compared),
        "exact": exact,
        "verdicts": {name: _verdicts(compared, name) for name in compared.trackers},
        "colours": _colours(compared),
        "settings": settings(compared),
        "figures": figures(compared),
        "paired": [table for group in groups if (table := paired(group)).rows],
        "left_out": compared.names[MOST_RUNS:],
        "commands": _commands(compared),
        "version": runs[0].manifest["versions"]["trackfield"],
        **_pictures(compared, runs, groups),
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
        fields = [figure for group in groups for figure in maps(group)]
        return {
            "pictures": {name: inline(_png(figure)) for name, figure in drawn.items() if figure is not None},
            "maps": [inline(_png(figure)) for figure in fields],
        }


def _png(figure: Any) -> bytes:
    file = io.BytesIO()
    figure.savefig(file, format="png")
    return file.getvalue()


def _colours(compared: Compared) -> dict[str, str]:
    return tracker_colours(compared.trackers)


def _facts(compared: Compared, runs: Sequence[Run]) -> list[list[str]]:
    """What each run was: a row each."""
    return [
        [
            name,
            run.scenario.name,
            str(run.metrics["seed"]),
            _HOW[run.metrics["driver"]],
            f"{length:g} s",
            f"{len(run.site.sensors):,}",
            run.scenario.link.model,
            run.manifest["started"].replace("T", " ").replace("+00:00", " UTC"),
        ]
        for name, run, length in zip(compared.names, runs, compared.lengths_s, strict=True)
    ]


def _verdicts(compared: Compared, tracker: str) -> list[Verdict]:
    """Of one tracker, in each run that has it."""
    return list(_each(compared, tracker))


def _each(compared: Compared, tracker: str) -> Iterator[Verdict]:
    for name, metrics in zip(compared.names, compared.metrics, strict=True):
        m = metrics["trackers"].get(tracker)
        if m is not None:
            state = {TRACKED: "", LOST: "bad"}.get(m["verdict"], "doubtful")
            yield Verdict(name, told(m), state, _sentence(m))


def _sentence(m: Mapping[str, Any]) -> str:
    """How far off, over how many steps, and how long there was no track."""
    if not m["steps_tracked"]:
        return f"It never had a track in {m['steps_expected']} steps."
    error = f"RMSE {number(m['rmse']['position'], 'm')}"
    if m["times_bound"] is not None:
        error += f", {number(m['times_bound'])} times the bound,"
    text = f"{error} over {number(m['steps_tracked'])} of {number(m['steps_expected'])} steps"
    blackout = m["longest_blackout_s"]
    return f"{text}; {number(blackout, 's')} without a track." if blackout else f"{text}."


def _commands(compared: Compared) -> list[tuple[str, str]]:
    """How to go on: (command, what it does)."""
    folders = " ".join(shlex.quote(str(folder)) for folder in compared.folders)
    return [
        (f"trackfield compare {folders}", "the table of this page"),
        (f"trackfield compare {folders} --rrd both.rrd", "tracks and errors on one timeline, for trackfield view"),
        (f"trackfield compare {folders} --exact 0", "whether tracks and frames are the same"),
        *((f"trackfield report {shlex.quote(str(folder))}", "the report of this run") for folder in compared.folders),
    ]


__all__ = ["NOTHING", "as_page", "as_table"]
