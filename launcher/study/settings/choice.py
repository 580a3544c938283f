"""The part of a study's page that says which setting of a key is best, figure by figure."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from statistics import fmean
from typing import Any, Final

from launcher.record.figures.costs import PeriodFigures
from launcher.record.figures.verdict import LOST
from launcher.records import BASE
from launcher.report.cells import NOTHING
from launcher.study.axes import ARCHITECTURE, TRACKER, Axis, Design, label, overlap
from launcher.study.figures import FIGURES, Better, Figure, scale_of
from launcher.study.intervals import FEWEST, mean_of
from launcher.study.results import StudyRun
from launcher.study.settings.fairness import common
from launcher.study.settings.paired import BySeed, Difference, Verdict, front, verdict

COMPARED: Final = (
    "base.rmse.position",
    "network.rmse.position",
    "base.share_within",
    "base.detection_s",
    "latency_ms.to_base.p95",
    "age_of_information_s.base_mean",
    "ledger.present.bytes",
    "ledger.setup.total_j",
    "ledger.power_w.present",
    "ledger.power_w.idle",
    "ledger.hottest",
    "ledger.lifetime_s.first_death",
    "ledger.lifetime_s.half_dead",
    "channel.use_peak",
    "passes.fixes_per_pass",
    "passes.location_m.mean",
    "passes.speed_m_s.mean",
    "passes.delay_s.mean",
    "camera.in_frame.at_aim",
    "camera.in_frame.frames",
    "camera.delay_s.mean",
)
"""The figures by which settings are compared, if any run has them."""
DECISIVE: Final = (
    "base.rmse.position",
    "base.share_within",
    "base.detection_s",
    "age_of_information_s.base_mean",
    "ledger.lifetime_s.first_death",
)
"""The figures of the Pareto front of all: what a field is for, and how long it lasts."""
SHARES: Final = ("base.share_within", "channel.use_peak", "camera.in_frame.at_aim", "camera.in_frame.frames")
"""Figures that are 1 at most."""
PURPOSES: Final = {
    "sync": "setting clocks",
    "reports": "reports",
    "control": "all other frames",
    "overhear": "overhearing",
    "listen": "idle listening",
    "sleep": "asleep",
    "sense": "readings",
}
"""What energy is spent on, in words."""
MOST_TABLES: Final = 24
"""Combinations of other keys that have a table each."""

_OPEN: Final = "not separated: "


@dataclass(frozen=True)
class Cell:
    """A setting's mean of a figure with its interval, and its difference to the best; ``mark``: best, open or none."""

    text: str
    interval: str
    difference: str
    mark: str


@dataclass(frozen=True)
class Line:
    """A figure: its title, which is better, the settings' cells, and what is said of the winner."""

    title: str
    better: Better
    cells: tuple[Cell, ...]
    said: str


@dataclass(frozen=True)
class Table:
    """The figures of one combination of the other keys, and the settings on the front of all decisive figures.

    Those that are ``lost`` lost half of their tracks or more at the base, and win nothing.
    """

    title: str
    lines: tuple[Line, ...]
    front: str
    lost: str


@dataclass(frozen=True)
class Choice:
    """Which setting of a key is best: ``tables`` for each combination of the other keys, ``left_out`` of which are not
    shown, and an ``overview`` of them. ``powers`` are what each spends on what, with a target and without one, in the
    first combination.

    ``same`` is what all settings had the same, ``different`` what they had not, and ``extras`` the processes of each
    that are not sensors, each in words. ``decisive`` names the figures of the front.
    """

    title: str
    tracker: str
    settings: tuple[str, ...]
    tables: tuple[Table, ...]
    left_out: int
    overview: tuple[tuple[str, tuple[str, ...]], ...]
    powers: tuple[tuple[str, tuple[tuple[str, str], ...]], ...]
    same: tuple[str, ...]
    different: tuple[str, ...]
    extras: tuple[tuple[str, str], ...]
    decisive: tuple[str, ...]
    level: str


def compared_axis(axes: Sequence[Axis]) -> Axis | None:
    """The key whose settings are compared: that of the architecture, or else the first that is varied."""
    own = [axis for axis in axes if overlap(axis.sets, ARCHITECTURE)]
    return (*own, *axes, None)[0]


def choice_of(design: Design, runs: Sequence[StudyRun]) -> Choice | None:
    """The part for a study's page; None if nothing is varied."""
    axis = compared_axis(design.axes)
    if axis is None:
        return None
    others = [one for one in design.axes if one is not axis]
    combos = [dict(zip((one.key for one in others), values, strict=True))
              for values in product(*(one.values for one in others))]  # fmt: skip
    found = [_settings(design, axis, combo, runs) for combo in combos]
    shown = [key for key in COMPARED if any(one.get(key) for settings in found for one in settings)]
    tables = [
        _table(titled(combo), axis, settings, shown, _lost(axis, combo, runs))
        for combo, settings in zip(combos, found, strict=True)
    ]
    groups = [
        [v.facts for v in design.variants if v.facts and all(v.values[key] == value for key, value in combo.items())]
        for combo in combos
    ]
    same, different = common(groups)
    names = tuple(map(label, axis.values))
    few = len(design.seeds) < FEWEST
    return Choice(
        "Which architecture for this field?" if overlap(axis.sets, ARCHITECTURE) else f"Which {axis.key}?",
        "" if axis.key == TRACKER else runs[0].metrics.rows().__next__()["tracker"],
        names,
        tuple(tables[:MOST_TABLES]),
        len(tables[MOST_TABLES:]),
        tuple(_overview(tables)) if len(tables) > 1 else (),
        tuple(_powers([_runs(runs, {**combos[0], axis.key: value}) for value in axis.values])),
        tuple(same),
        tuple(different),
        tuple(_extras(design, axis, names)),
        tuple(FIGURES[key].name for key in DECISIVE if key in shown),
        f"Too few seeds for intervals, which need {FEWEST}: nothing wins." if few else "",
    )


def titled(values: Mapping[str, Any]) -> str:
    """A combination in words; lists of tables, such as faults, without TOML's signs."""
    return ", ".join(f"{key}={_brief(value)}" for key, value in values.items())


def _brief(value: Any) -> str:
    if not isinstance(value, list | tuple) or any(not isinstance(one, Mapping) for one in value):
        return label(value)
    said = (" ".join([one.get("kind", ""), *_pairs(one)]).strip() for one in value)
    return "; ".join(said) or "none"


def _pairs(table: Mapping[str, Any]) -> Iterator[str]:
    return (f"{key} {label(value)}" for key, value in table.items() if key != "kind")


def _settings(
    design: Design, axis: Axis, combo: Mapping[str, Any], runs: Sequence[StudyRun]
) -> list[dict[str, BySeed]]:
    """Of each setting the figures of its runs by seed, of the first tracker of each."""
    found = []
    for value in axis.values:
        wanted = {**combo, axis.key: value}
        own: dict[str, dict[int, float]] = {}
        for run in _runs(runs, wanted):
            row = next(run.metrics.rows())
            for key in COMPARED:
                if (told := FIGURES[key].of(row)) is not None:
                    own.setdefault(key, {})[run.seed] = told
        found.append(own)
    return [dict(one) for one in found]


def _runs(runs: Sequence[StudyRun], wanted: Mapping[str, Any]) -> list[StudyRun]:
    """Those with these values."""
    return [run for run in runs if all(run.values[key] == value for key, value in wanted.items())]


def _powers(settings: Sequence[Sequence[StudyRun]]) -> Iterator[tuple[str, tuple[tuple[str, str], ...]]]:
    """The mean power (mW) of all batteries by purpose: of each setting with a target, and without one."""
    for purpose, name in PURPOSES.items():
        cells = tuple(
            (_power([run.metrics.ledger.present for run in own], purpose),
             _power([run.metrics.ledger.idle for run in own], purpose))
            for own in settings
        )  # fmt: skip
        if any(text != NOTHING for cell in cells for text in cell):
            yield name, cells


def _power(periods: Sequence[PeriodFigures], purpose: str) -> str:
    found = [spent / one.s * 1e3 for one in periods if one.s and (spent := getattr(one.by, purpose)) is not None]
    return _short(fmean(found)) if found else NOTHING


def _lost(axis: Axis, combo: Mapping[str, Any], runs: Sequence[StudyRun]) -> list[int]:
    """The settings of which half of the runs or more have lost the target at the base."""
    found = []
    for place, value in enumerate(axis.values):
        first = [next(iter(run.metrics.trackers.values())) for run in _runs(runs, {**combo, axis.key: value})]
        verdicts = [one.views.get(BASE, one).verdict for one in first]
        if verdicts and 2 * verdicts.count(LOST) >= len(verdicts):
            found.append(place)
    return found


def _table(
    title: str, axis: Axis, settings: Sequence[Mapping[str, BySeed]], shown: Sequence[str], lost: Collection[int]
) -> Table:
    names = tuple(map(label, axis.values))
    lines = tuple(_line(FIGURES[key], [one.get(key, {}) for one in settings], names, lost) for key in shown)
    decisive: dict[str, Better] = {key: FIGURES[key].better for key in DECISIVE if key in shown}
    return Table(title, lines, _named(front(settings, decisive, lost), names), _named(lost, names))


def _named(places: Iterable[int], names: Sequence[str]) -> str:
    return ", ".join(names[place] for place in places)


def _line(figure: Figure, settings: Sequence[BySeed], names: Sequence[str], lost: Collection[int]) -> Line:
    found = verdict(settings, figure.better, lost)
    means = [mean_of(list(one.values())) for one in settings]
    by, unit = scale_of(figure.unit, [one.value for one in means if one])
    cells = []
    for place, (mean, gap) in enumerate(zip(means, found.differences, strict=True)):
        if mean is None:
            cells.append(Cell(NOTHING, "", "", ""))
            continue
        ends = ""
        if mean.low is not None and mean.high is not None:
            high = min(mean.high, 1.0) if figure.key in SHARES else mean.high
            ends = f"{_short(mean.low / by)} to {_short(high / by)}"
        mark = "won" if place == found.winner else "open" if place == found.best or place in found.open else ""
        cells.append(Cell(_short(mean.value / by), ends, "" if place == found.best else _gap(gap, by), mark))
    return Line(f"{figure.name} [{unit}]" if unit else figure.name, figure.better, tuple(cells), _said(found, names))


def _short(value: float) -> str:
    """About three digits."""
    size = abs(value)
    if size >= 100 or not size:
        return f"{value:,.0f}"
    return f"{value:.1f}" if size >= 10 else f"{value:.2f}" if size >= 0.1 else f"{value:.2g}"


def _gap(gap: Difference | None, by: float) -> str:
    """A difference to the best, with its sign and interval."""
    if gap is None or gap.low is None or gap.high is None:
        return ""
    low, high = (f"{'+' if end > 0 else ''}{_short(end / by)}" for end in (gap.low, gap.high))
    return f"{low} to {high}"


def _said(found: Verdict, names: Sequence[str]) -> str:
    """The winner, or those among which none wins."""
    if found.winner is not None:
        return names[found.winner]
    if found.best is None or not found.open:
        return NOTHING
    return f"{_OPEN}{_named(sorted((found.best, *found.open)), names)}"


def _overview(tables: Sequence[Table]) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Each figure with its winners in all tables."""
    for place, line in enumerate(tables[0].lines):
        title = line.title.partition(" [")[0]
        yield title, tuple(_winner(table.lines[place].said) for table in tables)
    yield "on the front of all", tuple(table.front for table in tables)


def _winner(said: str) -> str:
    return NOTHING if said.startswith(_OPEN) else said


def _extras(design: Design, axis: Axis, names: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Each setting and its processes that are not sensors, of the first combination that has it."""
    for value, name in zip(axis.values, names, strict=True):
        facts = next((v.facts for v in design.variants if v.values[axis.key] == value and v.facts), None)
        if facts is not None:
            yield name, ", ".join(facts.extras) or "none"
