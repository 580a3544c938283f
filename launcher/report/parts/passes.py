"""Targets that passed clusters: each event, its reports and what trackers made of it, and what was to be heard."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from launcher.heard import Event, Outcome, Sound
from launcher.record.figures.passes.metrics import ERRORS
from launcher.record.heard.wav import wav
from launcher.record.words import span
from launcher.report import style
from launcher.report.cells import NOTHING, Table, ids, number
from launcher.report.folder import Run
from launcher.report.leading import hears
from launcher.report.parts import passed
from launcher.report.parts.machine import Line
from trackfield.role import NS

MOST_EVENTS: Final = 30
"""Of more events the first ones are listed."""
ACROSS: Final = 3
MOST_MAPS: Final = 6
"""Of more events the first ones are drawn."""


class Played(NamedTuple):
    """A sound on the page: whose it is, when that was loudest, and the file as a data URL."""

    name: str
    url: str


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    heard = run.heard
    if not run.metrics["passes"]["events"] and not heard.events:
        return {"lines": [], "events": Table([], []), "more": 0, "led": False, "played": []}
    more = max(len(heard.events) - MOST_EVENTS, 0)
    return {"lines": lines(run), "events": events(run), "more": more, "led": hears(run), "played": played(run)}


def shown(run: Run) -> bool:
    """Whether there is anything to show."""
    return bool(run.metrics["passes"]["events"] or run.heard.events)


def lines(run: Run) -> list[Line]:
    """The figures of metrics.json."""
    passes = run.metrics["passes"]
    found: list[Line] = []
    if run.site.paths:
        found += [
            ("passes of a cluster, by the true paths", f"{passes['events']:,}", False),
            ("of these, those in reach of enough sensors for a fix", f"{passes['enough']:,}", False),
        ]
    for name, one in passes["trackers"].items():
        if not one["fixes"] and not one["refused"]:
            continue
        false, refused = one["false_fixes"], sum(one["refused"].values())
        said = "" if false is None else f"; {false:,} false"
        found.append((f"{name}: fixes", f"{one['fixes']:,}{said}; {refused:,} refused", bool(false)))
        if one["location_m"]["mean"] is not None:
            mean, worst = (_errors(*(one[key][which] for key in ERRORS)) for which in ("mean", "max"))
            off = "; ".join(f"{a}, {b}" for a, b in zip(mean, worst, strict=True))
            found.append((f"{name}: errors of location, speed, heading, mean and worst", off, False))
        if one["delay_s"]["mean"] is not None:
            late = f"{span(one['delay_s']['mean'])}, {span(one['delay_s']['max'])}"
            found.append((f"{name}: from the last pass to the fix, mean and most", late, False))
    return [*found, *_heads(run)]


def _heads(run: Run) -> list[Line]:
    """Who led, and what the base knew of it; nothing without clusters."""
    leaders, age = run.metrics["leaders"], run.metrics["age_of_information_s"]
    if not hears(run):
        return []
    taken = f"{leaders['take_overs']:,}, {leaders['false_take_overs']:,} of them false"
    found: list[Line] = [("heads that took over from another one", taken, False)]
    if age["mean"] is not None:
        ages = f"{span(age['mean'])}, {span(age['p95'])}"
        found.append(("how old what the base knew was, mean and 95 %", ages, False))
    return found


# --- each event -------------------------------------------------------------------------------------------------------


def events(run: Run) -> Table:
    """A row for each event and tracker."""
    rows = [
        _row(run, event, outcome, first=not number_of)
        for event in run.heard.events[:MOST_EVENTS]
        for number_of, outcome in enumerate(event.outcomes)
    ]
    head = ["event", "head", "sensors", "tracker", "fix", "location", "speed", "heading", "after"]
    known = len(head) if run.site.paths else head.index("location")
    return Table(head[:known], [row[:known] for row in rows])


def _row(run: Run, event: Event, outcome: Outcome, *, first: bool) -> list[str]:
    """The sensors stand in the order of how loud they heard the target; errors are beside the truth."""
    fix = run.heard.fix(event, outcome)
    off = fix.errors if fix is not None else None
    errors = [NOTHING] * 3 if off is None else _errors(*off)
    after = NOTHING if fix is None or fix.after_s is None else span(fix.after_s)
    at = f"{(event.begin_ns - run.site.origin_ns) / NS:.2f} s"
    what = outcome.text if fix is None or fix.target or not run.site.paths else f"{outcome.text}, false"
    whose = (event.head, ids(event.ranked) or NOTHING) if first else ("", "")
    return [at, *whose, outcome.tracker, what, *errors, after]


def _errors(location_m: float | None, speed_m_s: float | None, heading_deg: float | None) -> list[str]:
    heading = NOTHING if heading_deg is None else f"{heading_deg:.2f}°"
    return [number(location_m, "m"), number(speed_m_s, "m/s"), heading]


# --- what was heard ---------------------------------------------------------------------------------------------------


def played(run: Run) -> list[Played]:
    """The sounds of an event, to be played on the page."""
    return [
        Played(f"{sound.sensor}, {_rank(run, sound)}", _url(wav(sound.samples, sound.rate)))
        for sound in run.heard.sounds
    ]


def _url(file: bytes) -> str:
    return f"data:audio/wav;base64,{base64.b64encode(file).decode('ascii')}"


def _rank(run: Run, sound: Sound) -> str:
    event = run.heard.loudest
    return "the loudest" if event is not None and event.ranked[0] == sound.sensor else "the weakest"


def passes(run: Run) -> Figure | None:
    """A map for each of the first events."""
    drawn = run.heard.events[:MOST_MAPS]
    if not drawn:
        return None
    rows = -(-len(drawn) // ACROSS)
    figure = Figure(figsize=(style.WIDTH, 2.75 * rows + 0.35), layout="constrained")
    grid = figure.subplots(rows, ACROSS, squeeze=False).ravel()
    for axes, event in zip(grid, drawn, strict=False):
        passed.draw(axes, run, event)
    for axes in grid[len(drawn) :]:
        axes.set_axis_off()
    figure.legend(
        *passed.entries(run), loc="outside upper left", ncols=8, handlelength=1.4, columnspacing=1.2, fontsize=7.5
    )
    return figure


def heard(run: Run) -> Figure | None:
    """The waveforms of the loudest and the weakest sensor, their levels, and the fitted curves."""
    sounds = run.heard.sounds
    if not sounds:
        return None
    figure = Figure(figsize=(style.WIDTH, 2.2 * len(sounds) + 0.3), layout="constrained")
    grid = figure.subplots(len(sounds), 1, squeeze=False)[:, 0]
    for index, (axes, sound) in enumerate(zip(grid, sounds, strict=True)):
        _wave(axes, run, sound, named=not index)
    grid[-1].set_xlabel("emulated time [s]")
    return figure


def _wave(axes: Axes, run: Run, sound: Sound, *, named: bool) -> None:
    """Amplitudes on the left, levels on the right."""
    begun_s = (sound.first_ns - run.site.origin_ns) / NS
    low, high, t_s = _envelope(sound)
    axes.fill_between(begun_s + t_s, low, high, color=style.OUTCOMES["ignored"], lw=0, label="waveform")
    most = 1.1 * float(np.abs(sound.samples).max(initial=1e-9))
    axes.set(ylim=(-most, most), xlim=(begun_s, begun_s + len(sound.samples) / sound.rate), ylabel="amplitude")
    axes.set_title(f"{sound.sensor}, {_rank(run, sound)}", fontsize=8.5, loc="right")
    level = axes.twinx()
    level.grid(visible=False)
    level.spines["right"].set_visible(True)
    level.plot(begun_s + sound.levels[:, 0], sound.levels[:, 1], color="#56b4e9", lw=0.7, label="level above 100 Hz")
    level.plot(begun_s + sound.levels[:, 0], sound.levels[:, 2], color="#0072b2", lw=1.8, label="fitted pass")
    level.set_ylabel("level [dB]")
    marks = (sound.peak_ns, "closest point of approach", "-"), (sound.known_ns, "triggered", "--")
    for at_ns, label, dashes in marks:
        if at_ns is not None:
            level.axvline((at_ns - run.site.origin_ns) / NS, color=style.DEAD, ls=dashes, lw=1.2, label=label)
    if named:
        _legend(axes, level)


def _legend(*each: Axes) -> None:
    pairs: list[Sequence[Any]] = [pair for axes in each for pair in zip(*axes.get_legend_handles_labels(), strict=True)]
    each[0].legend(
        [one[0] for one in pairs], [one[1] for one in pairs], loc="lower left", bbox_to_anchor=(-0.01, 1.0), ncols=5,
        borderaxespad=0.2, handlelength=1.4, columnspacing=1.0, fontsize=7.5,
    )  # fmt: skip


def _envelope(sound: Sound, parts: int = 700) -> tuple[Any, Any, Any]:
    """The least and the greatest amplitude of each of so many parts, and when (s) they begin."""
    size = max(len(sound.samples) // parts, 1)
    cut = sound.samples[: len(sound.samples) // size * size].reshape(-1, size)
    return cut.min(axis=1), cut.max(axis=1), np.arange(len(cut)) * size / sound.rate


FIGURES: Final[style.Figures] = {"passes": passes, "heard": heard}
