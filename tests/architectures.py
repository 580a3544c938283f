"""Which architecture for which field: the tables of docs/architectures.md.

    python -m tests.architectures [--only NAME ...] [--seeds N] [--jobs 2] [--write docs/architectures.md]

Each part is a ``trackfield study`` whose command stands above its table; what it says is what the study's page says
(``launcher/study/settings/``). A setting that the program refuses is left out of the study, and its message is printed.
Runs are kept in ``--keep``, and are not repeated if neither scenario nor code has changed. ``--write`` puts each table
between its markers in the page and leaves all other text as it is.
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from launcher.plan.prepare import load
from launcher.study.axes import Design, design, in_words, label, overlap, parse_vary
from launcher.study.folder import StudyFolder
from launcher.study.results import StudyRun
from launcher.study.settings.choice import Cell, Choice, Line, Table, choice_of
from launcher.study.studies import fill
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario

_ARCHITECTURE: Final = "architecture"
_KINDS: Final = "architecture.kind=centralised,clusters,location-central,elected"
_TREE: Final = (
    "architecture={kind='centralised',multihop=true},{kind='clusters'},{kind='clusters',masters=64},"
    "{kind='location-central',multihop=true},{kind='elected',multihop=true}"
)
_HOPS: Final = (
    "architecture={kind='centralised',multihop=true},{kind='clusters'},"
    "{kind='location-central',multihop=true},{kind='elected',multihop=true}"
)
_PAID: Final = (
    "architecture={kind='centralised'},{kind='clusters',master_battery_j=20000},"
    "{kind='location-central'},{kind='elected'}"
)
_BUS: Final = ('fusion.trackers=["imm-ukf"]',)
_SHORT: Final = (*_BUS, "target.steps=60", "run.idle_s=20")
"""The first minute of the bus alone, and a short time without it: its power is the same in all windows."""
_FAULTS: Final = (
    "faults=[],[{kind='kill',part='tracking',nearest=1,at_s=30}],[{kind='kill',part='base',at_s=30}],"
    "[{kind='kill',share=0.1,at_s=30}]"
)
_MADE: Final = (
    *_BUS,
    "field.spacing_m=25",
    "sensor={kind='range',range_m=32}",
    "link={model='lognormal_prr',radio='802154-0dbm',ack=3}",
    "target={path='drifting',steps=20,q=0.05,speed_m_s=5,heading_deg=45,start_m=[60,60],half_width_m=1e7}",
    "fusion.prior=none",
    "run.idle_s=10",
)
_NEAR: Final = (
    "field={layout='pentagon',corner_m=10}",
    "link={model='lognormal_prr',radio='802154-20dbm',ack=3,range_m=60}",
    "run.idle_s=20",
)
"""Sensors in fives along the first minute of the track, those of neighbouring fives in reach of each other."""
_PASSES: Final = (
    *_NEAR,
    'fusion.trackers=["ml"]',
    "fusion.assumed_noise=4",
    "fusion.max_age_s=2",
    "target.step_s=0.5",
    "target.steps=120",
    "sensor={kind='cpa',time_sd_s=0.025,time_floor_m=8,distance_power=2,speed_power=1,strength_sd=0.03}",
)
_HEARD: Final = "architecture={kind='centralised',multihop=true},{kind='cpa'},{kind='cpa',interest_s=60}"
_SEEN: Final = (
    "architecture={kind='centralised',multihop=true},{kind='clusters',masters=20},"
    "{kind='location-central',multihop=true},{kind='elected',multihop=true}"
)

_MAIN: Final = (
    "RMSE at the base",
    "RMSE in the network",
    "share of steps tracked at the base",
    "detection delay at the base",
    "age of what the base knows",
    "power with a target",
    "first battery empty, target 1 % of the time",
)
"""The figures of a table of several conditions."""


# --- parts ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Part:
    """A study: ``vary`` names the key of the architecture first, and perhaps another one, whose values are conditions.

    ``figures`` are those shown of each condition, by their names; of a study without conditions all are shown.
    """

    name: str
    scenario: str
    settings: tuple[str, ...]
    vary: tuple[str, ...]
    seeds: int
    figures: tuple[str, ...] = _MAIN

    @property
    def command(self) -> str:
        """What runs the same study."""
        settings = [word for one in self.settings for word in ("--set", one)]
        varied = [word for one in self.vary for word in ("--vary", one)]
        words = ["trackfield", "study", self.scenario, "--seeds", str(self.seeds), *settings, *varied]
        return " ".join(map(quoted, words))

    def loaded(self) -> Scenario:
        """The scenario before anything is varied."""
        return load(self.scenario, settings=self.settings)


PARTS: Final = {
    part.name: part
    for part in (
        Part("bus", "bus", _BUS, (_KINDS,), 10),
        Part("one-hop", "bus", (*_SHORT, "link={model='lognormal_prr',radio='802154-20dbm',ack=3}"), (_KINDS,), 3),
        Part("tree", "bus", (*_SHORT, "link={model='lognormal_prr',radio='802154-0dbm',ack=3}"), (_TREE,), 3),
        Part("masters-pay", "bus", _SHORT, (_PAID,), 3),
        Part("losses", "bus", _SHORT, (_KINDS, "link.extra_loss=0,0.1,0.2,0.4"), 3),
        Part("faults", "bus", _SHORT, (_KINDS, _FAULTS), 3),
        Part("speed", "bus", (*_BUS, "target.steps=50", "run.idle_s=20"), (_KINDS, "target.hasten=1,2"), 3),
        Part("density", "bus", _SHORT, (_KINDS, "field.spacing_m=40,50,70"), 3),
        Part("passes", "bus", _PASSES, (_HEARD,), 3),
        Part("bearings", "bus", (*_NEAR, *_SHORT[:-1]), (_SEEN,), 3),
        Part("nodes", "zhai-spcpf", _MADE, (_HOPS, "field.nodes=121,250,500,1000"), 2),
    )
}


@dataclass(frozen=True)
class Refused:
    """A setting of the architecture that the program refuses, and what it says."""

    setting: str
    said: str


def designed(part: Part, *, each_seed: bool = False) -> tuple[Part, Design, list[Refused]]:
    """The study without the settings that are refused; those too, and the part as it is left, for its command.

    A study plans the first seed alone; with ``each_seed`` all are tried. Raises ``ScenarioError`` if fewer than two
    settings are left.
    """
    seeds = range(1, part.seeds + 1)
    scenario, varied = part.loaded(), parse_vary(part.vary)
    if not each_seed:
        try:
            return part, design(scenario, seeds, varied), []
        except ScenarioError:
            pass
    key, *others = varied
    kept, refused = [], []
    for value in varied[key]:
        try:
            for seed in seeds if each_seed else seeds[:1]:
                design(scenario.set(key, value), [seed], {other: varied[other] for other in others})
        except ScenarioError as error:
            refused.append(Refused(named(key, value), f"{error}"))
        else:
            kept.append(value)
    if len(kept) < 2:
        raise ScenarioError("; ".join(f"{one.setting}: {one.said}" for one in refused), key=part.name)
    words = f"{key}={','.join(map(toml, kept))}"
    whole = replace(part, vary=(words, *part.vary[1:]))
    return whole, design(scenario, seeds, {**varied, key: kept}), refused


def toml(value: object) -> str:
    """A value of an axis as ``--vary`` takes it."""
    if isinstance(value, dict):
        return f"{{{','.join(f'{name}={toml(one)}' for name, one in value.items())}}}"
    if isinstance(value, list):
        return f"[{','.join(map(toml, value))}]"
    return repr(value) if isinstance(value, str) else label(value)


def run(part: Part, jobs: int, keep: Path) -> tuple[Part, Choice, list[Refused]]:
    """Do what is missing of a study; which of its settings is best."""
    left, whole, refused = designed(part)
    try:
        folder = _filled(whole, jobs, keep / part.name)
    except ScenarioError:  # of a later seed
        left, whole, refused = designed(part, each_seed=True)
        folder = _filled(whole, jobs, keep / part.name)
    runs: Sequence[StudyRun] = [folder.load(place, seed) for place, seed in whole.jobs]
    choice = choice_of(whole, runs)
    assert choice is not None
    axis = whole.axes[0]
    names = {label(value): named(axis.key, value) for value in axis.values}
    return left, renamed(choice, names), refused


def _filled(whole: Design, jobs: int, path: Path) -> StudyFolder:
    """The study's folder with all its runs."""
    folder = StudyFolder(path, whole)
    folder.begin([])
    fill(folder, jobs, lines=True)
    return folder


def named(key: str, value: object) -> str:
    """A setting in words: the kind of the architecture, and what else of it is set."""
    if not overlap(key, _ARCHITECTURE) or not isinstance(value, dict):
        return label(value)
    others = {name: one for name, one in value.items() if name != "kind"}
    return f"{value['kind']} ({in_words(others)})" if others else str(value["kind"])


def renamed(choice: Choice, names: dict[str, str]) -> Choice:
    """The same with other names of its settings, wherever they stand."""

    def told(text: str) -> str:
        for old in sorted(names, key=len, reverse=True):
            text = text.replace(old, names[old]) if old.startswith("{") else text
        return text

    return replace(
        choice,
        settings=tuple(map(told, choice.settings)),
        tables=tuple(
            Table(
                table.title,
                tuple(replace(line, said=told(line.said)) for line in table.lines),
                told(table.front),
                told(table.lost),
            )
            for table in choice.tables
        ),
        extras=tuple((told(name), what) for name, what in choice.extras),
    )


# --- Markdown ---------------------------------------------------------------------------------------------------------


def written(part: Part, choice: Choice, refused: Sequence[Refused]) -> Iterator[str]:
    """The lines of a part: its command, its tables, and what is to be said of them."""
    yield from ("", f"    {part.command}", "")
    for one in refused:
        yield from (f"Refused: {one.setting}: `{' '.join(one.said.split())}`.", "")
    if len(choice.tables) == 1:
        yield from _whole(choice)
    else:
        yield from _conditions(choice, part.figures)
    if choice.level:
        yield from ("", choice.level)
    for table in choice.tables:
        where = f"{table.title}: " if table.title else ""
        if table.lost:
            yield from ("", f"{where}{table.lost} lost the target at the base in half of the runs or more.")
    yield ""


def _whole(choice: Choice) -> Iterator[str]:
    """All figures of a study without conditions, energy by purpose, front, and what was the same."""
    table = choice.tables[0]
    yield from head(["figure", *choice.settings, "best"])
    for line in table.lines:
        yield row([line.title, *map(_cell, line.cells), _best(choice, line)])
    if choice.powers:
        yield from ("", "Power of all batteries by purpose, in mW, with a target / without one:", "")
        yield from head(["", *choice.settings])
        for purpose, cells in choice.powers:
            yield row([purpose, *(f"{present} / {idle}" for present, idle in cells)])
    yield from ("", f"On the Pareto front of {', '.join(choice.decisive)}: **{table.front or 'none'}**.")
    yield from ("", f"The same in all: {'; '.join(choice.same)}.")
    if choice.different:
        yield f"Not the same: {'; '.join(choice.different)}."
    yield f"Besides sensors: {'; '.join(f'{name}: {what}' for name, what in choice.extras)}."


def _cell(cell: Cell) -> str:
    """A mean, its interval, and the interval of its difference to the best."""
    text = f"**{cell.text}**" if cell.mark == "won" else cell.text
    ends = f" [{cell.interval.replace(' to ', ', ')}]" if cell.interval else ""
    return f"{text}{ends}{f'; Δ {cell.difference}' if cell.difference else ''}"


def _conditions(choice: Choice, figures: Iterable[str]) -> Iterator[str]:
    """A row for each figure and condition, and the front of each condition."""
    yield from head(["figure", "with", *choice.settings, "best"])
    for name in figures:
        for table in choice.tables:
            for line in (one for one in table.lines if _titled(one) == name):
                cells = (f"**{one.text}**" if one.mark == "won" else one.text for one in line.cells)
                yield row([line.title, f"`{table.title}`", *cells, _best(choice, line)])
    yield from ("", "On the Pareto front:", "")
    yield from (f"- `{table.title}`: {table.front or 'none'}" for table in choice.tables)


def _best(choice: Choice, line: Line) -> str:
    """The winner; or none, and between which it is open if not between all."""
    if choice.level:
        return ""
    if not any(cell.mark == "open" for cell in line.cells):
        return line.said
    able = [name for name, cell in zip(choice.settings, line.cells, strict=True) if cell.mark == "open"]
    some = sum(bool(cell.mark or cell.difference) for cell in line.cells)
    return f"none of {', '.join(able)}" if len(able) < some else "none"


def _titled(line: Line) -> str:
    """The name of its figure, without the unit."""
    return line.title.partition(" [")[0]


def head(cells: Sequence[str]) -> Iterator[str]:
    """The first two lines of a table."""
    yield row(cells)
    yield row(["---"] * len(cells))


def row(cells: Iterable[str]) -> str:
    """A line of a table."""
    return f"| {' | '.join(one.replace('|', chr(92) + '|') for one in cells)} |"


def marks(name: str) -> tuple[str, str]:
    """What stands before and after the tables of a part."""
    return f"<!-- {name}: python -m tests.architectures -->", f"<!-- end of {name} -->"


def quoted(word: str) -> str:
    """As a shell takes it; in double quotes where it has single ones."""
    return f'"{word}"' if "'" in word and not set('"$`\\\\!') & set(word) else shlex.quote(word)


def put(page: str, name: str, lines: Iterable[str]) -> str:
    """The page with these lines between the marks of a part. Raises ``ValueError`` if it has none."""
    begin, end = marks(name)
    before, found, rest = page.partition(begin)
    _, closed, after = rest.partition(end)
    if not found or not closed:
        raise ValueError(f"the page has no {begin} ... {end}")
    return "\n".join([before + begin, *lines, end + after])


def main() -> None:
    """Run the parts that are asked for; print their tables, and write them into the page if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=PARTS, metavar="NAME", help=f"of {', '.join(PARTS)}")
    parser.add_argument("--seeds", type=int, help="of each combination; unset: as many as the part has")
    parser.add_argument("--jobs", type=int, default=2, help="runs at a time")
    parser.add_argument("--keep", type=Path, default=Path("build/architectures"), help="where runs are kept")
    parser.add_argument("--write", type=Path, help="the page whose tables are to be replaced")
    asked = parser.parse_args()
    for name in asked.only or PARTS:
        part = replace(PARTS[name], seeds=asked.seeds or PARTS[name].seeds)
        try:
            lines = list(written(*run(part, asked.jobs, asked.keep)))
        except ScenarioError as error:
            lines = ["", f"    {part.command}", "", f"Refused: `{' '.join(str(error).split())}`.", ""]
        print(f"## {name}", *lines, sep="\n", flush=True)
        if asked.write:
            asked.write.write_text(put(asked.write.read_text(encoding="utf-8"), name, lines), encoding="utf-8")


if __name__ == "__main__":
    main()
