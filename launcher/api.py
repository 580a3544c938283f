"""The Python API: what ``import trackfield as tf`` offers beside scenarios and errors (docs/python.md)."""

from __future__ import annotations

import signal
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal, get_args

import pyarrow as pa

from launcher.files import MESSAGES_TABLE, SCENARIO, TRACKS_TABLE
from launcher.options import check_elsewhere
from launcher.plan.bridges import OPTION, bridged, in_folder, looked_for, parse, with_terminals
from launcher.plan.extensions import check_importable
from launcher.plan.prepare import checked, planned, warned
from launcher.processes.limits import check_machine
from launcher.record.figures.measures import RunFigures
from launcher.record.folder import keep, prepare_folder
from launcher.record.latest import run_folder
from launcher.record.reading.files import check_run, read_figures, read_table
from launcher.run import Outcome, run_processes, run_virtual
from launcher.show import Quiet
from launcher.study.comparison.runs import Compared, read_runs
from launcher.study.results import figures_table
from launcher.study.studies import Study
from launcher.study.studies import study as run_study
from trackfield.errors import RunFailed, ScenarioError
from trackfield.filters.trackers import TRACKERS
from trackfield.scenario import Scenario
from trackfield.scenario.nearest import suggestion
from trackfield.words import quoted

if TYPE_CHECKING:
    from launcher.study.pictures.look import Picture

Driver = Literal["virtual", "processes"]
Folder = str | Path
_WIDTH: Final = 160
"""Width of a printed comparison, in characters."""


@dataclass(frozen=True)
class Result:
    """A finished run in its folder, ``path``; its parts are read on first use (docs/metrics.md)."""

    path: Path

    @cached_property
    def metrics(self) -> RunFigures:
        """The figures of metrics.json, by its keys. Raises ``ScenarioError`` if some are missing or damaged."""
        return read_figures(self.path)

    @cached_property
    def tracks(self) -> pa.Table:
        """tracks.parquet: a row for each tracker, target and step. Raises ``ScenarioError`` if it is damaged."""
        return read_table(self.path, TRACKS_TABLE)

    @cached_property
    def messages(self) -> pa.Table:
        """messages.parquet: a row for each frame and receiver. Raises ``ScenarioError`` if it is damaged."""
        return read_table(self.path, MESSAGES_TABLE)

    def view(self, *, web: bool = False) -> None:
        """Open the timeline in the viewer, or in a browser, and wait until it is closed."""
        from launcher.timeline.view import open_viewer

        open_viewer(self.path, web)

    def report(self, *, anew: bool = False) -> Path:
        """The path of report.html, which is written if it is missing, or written again if ``anew``."""
        from launcher.report import PAGE, write_report

        page = self.path / PAGE
        return page if page.exists() and not anew else write_report(self.path)

    def plot(self) -> Picture:
        """The field with the tracks, and their errors over time: a matplotlib figure, which notebooks show."""
        from launcher.study.pictures.overview import overview

        return overview(self.path)

    def _repr_html_(self) -> str:
        from launcher.study.notebook import run_html

        return run_html(self.path, self.metrics)


class Comparison:
    """Runs side by side: as text, as a table in a notebook, as a page; ``table`` holds the figures."""

    def __init__(self, runs: Sequence[Result]) -> None:
        self.runs = tuple(runs)

    @cached_property
    def table(self) -> pa.Table:
        """A row for each run and tracker, as in a study's table; ``path`` says which run it is."""
        table = figures_table(run.metrics for run in self.runs)
        paths = [str(run.path) for run in self.runs for _ in run.metrics.trackers]
        return table.add_column(0, "path", pa.array(paths, pa.string()))

    def to_html(self) -> str:
        """The page that ``trackfield compare --html`` writes: one file that opens offline."""
        from launcher.study.comparison.page import as_page

        return as_page(self._compared)

    def _repr_html_(self) -> str:
        from launcher.study.comparison.page import as_table

        return as_table(self._compared)

    def __repr__(self) -> str:
        from rich.console import Console

        from launcher.study.side_by_side import show

        console = Console(width=_WIDTH, markup=False, emoji=False, highlight=False)
        with console.capture() as text:
            show(self._compared, console)
        return text.get()

    @cached_property
    def _compared(self) -> Compared:
        return read_runs([run.path for run in self.runs], "runs")


def run(
    scenario: Scenario | str | Path,
    *,
    seed: int | None = None,
    driver: Driver = "virtual",
    speed: float | None = None,
    bridge: Mapping[str, str] | None = None,
    out: Folder = "runs/",
) -> Result:
    """Run a scenario and leave a run folder: ``out``, or, if that ends with a slash, one of its own name below it.

    ``scenario`` may be the name of a packaged one or a TOML file. ``seed`` decides every random draw (None: the
    scenario's own); ``speed`` is emulated seconds per second of a run over processes (None: 1). ``bridge`` has real
    devices, or ``"pty"``, by the ids of processes with a serial line, in whose place they are in such a run. Needs no
    ``if __name__ == "__main__"`` and works in notebooks and threads. Raises
    ``ScenarioError`` for bad input and ``RunFailed`` if the run failed or a process died unplanned; then there is a
    folder all the same. Ctrl-C ends the run early, leaves a complete folder, and is raised afterwards.
    """
    if driver not in get_args(Driver):
        what = f"is {driver!r}{suggestion(str(driver), get_args(Driver))}"
        raise ScenarioError(what, key="driver", expected=" or ".join(get_args(Driver)))
    if driver == "virtual" and speed is not None:
        what = "virtual time goes as fast as the machine can"
        raise ScenarioError(what, key="speed", expected='driver="processes" with it')
    speed = 1.0 if speed is None else speed
    with _arguments():
        devices = _devices(bridge or {}, driver, speed)
        chosen = checked(_scenario(scenario), seed)
        plan = looked_for(bridged(warned(planned(chosen, speed)), devices))
        check_elsewhere(plan, (), virtual=driver == "virtual")
        if driver == "processes":
            check_importable(plan)
            check_machine(plan, router=True)
        inside = isinstance(out, str) and out.endswith("/")
        folder = prepare_folder(None if inside else Path(out), chosen.name, chosen.seed, below=Path(out))
    keep(chosen, folder)
    again = ["trackfield", "run", str(folder / SCENARIO)]
    again += [part for id, device in devices.items() for part in (OPTION, f"{id}={device}")]
    if driver == "virtual":
        return _finished(run_virtual(plan, folder, [*again, "--virtual"]))
    plan = with_terminals(in_folder(plan, folder), folder)
    return _finished(run_processes(plan, folder, Quiet(), [*again, "--speed", f"{speed:g}"]))


def study(
    scenario: Scenario | str | Path,
    seeds: Iterable[int],
    vary: Mapping[str, Iterable[Any]] | None = None,
    *,
    n_jobs: int = -1,
    out: Folder | None = None,
) -> Study:
    """Run a scenario in virtual time with each of these seeds, on ``n_jobs`` cores (-1: all), without run folders.

    ``scenario`` may be a name or a file, as for ``run``. ``vary`` has values by key, ``{"field.spacing_m": [50, 75]}``;
    all combinations are run, and checked before the first of them. The key ``tracker`` takes one tracker at a time.

    The figures are those of single runs. ``out`` is a folder as ``trackfield study`` leaves it, with tables, pictures
    and a page; runs that are in it already are not run again. ``joblib.parallel_config`` selects another backend, like
    a Dask cluster; ``trackfield study --dask`` also checks that its workers have this Trackfield. A terminal shows
    progress. Raises ``ScenarioError``.
    """
    with _arguments():
        return run_study(_scenario(scenario), seeds, vary, n_jobs=n_jobs, out=None if out is None else Path(out))


def open(folder: Folder) -> Result:
    """The result in a run folder; ``latest`` and ``latest~1`` are the last runs below runs/.

    Raises ``ScenarioError`` if it is not the folder of a finished run.
    """
    path = run_folder(folder)
    check_run(path)
    return Result(path)


def replay(
    run: Result | Folder, trackers: Sequence[str] = (), *, drop_late: bool = False, out: Folder | None = None
) -> Result:
    """Fuse the reports of a finished run again, with these trackers (none: its own), into a new run folder.

    With ``drop_late``, reports that came after their deadline are left out. Raises ``ScenarioError``.
    """
    from launcher.study.replay import replay as fuse

    folder = run.path if isinstance(run, Result) else run_folder(run)
    flags = [*(part for name in trackers for part in ("--tracker", name)), *(["--drop-late"] if drop_late else [])]
    again = ["trackfield", "replay", str(folder), *flags]
    with _arguments():
        fused = fuse(folder, trackers, drop_late=drop_late, out=None if out is None else Path(out), command=again)
    return _finished(fused)


def compare(runs: Iterable[Result | Folder]) -> Comparison:
    """Finished runs, or their folders, side by side. Raises ``ScenarioError`` unless there are two different ones."""
    found = [one if isinstance(one, Result) else open(one) for one in runs]
    if len(found) < 2:
        raise ScenarioError(f"{len(found)} given", key="runs", expected="two runs or more")
    read_runs([one.path for one in found], "runs")
    return Comparison(found)


def _devices(bridge: Mapping[str, str], driver: Driver, speed: float) -> dict[str, str]:
    """The devices of a run. Raises ``ScenarioError`` if it can have none."""
    if not (isinstance(bridge, Mapping) and all(isinstance(text, str) for pair in bridge.items() for text in pair)):
        raise ScenarioError(
            f"is {quoted(bridge)}", key=OPTION, expected='a dict of devices by ids, like {"base": "/dev/ttyUSB0"}'
        )
    if bridge and (driver == "virtual" or speed != 1):
        what, expected = "a device goes by the wall clock", 'driver="processes" with it, and no other speed than 1'
        raise ScenarioError(what, key=OPTION, expected=expected)
    return parse([f"{id}={device}" for id, device in bridge.items()])


def _finished(outcome: Outcome) -> Result:
    if outcome.complaints:
        died = outcome.metrics["processes"]["died"]
        process = died[0]["id"] if died else ""
        log = str(outcome.folder / "logs" / f"{process}.log") if process else ""
        said = "\n".join([*outcome.complaints, f"what was recorded is in {outcome.folder}"])
        raise RunFailed(said, process=process, log=log)
    if outcome.signal is not None:
        signal.raise_signal(outcome.signal)
    return Result(outcome.folder)


def _scenario(given: Scenario | str | Path) -> Scenario:
    """The scenario that was given, or that of this name or file."""
    if isinstance(given, Scenario):
        return given
    if not isinstance(given, str | Path):
        expected = 'a scenario, or the name or file of one, like "zhai-spcpf"'
        raise ScenarioError(f"is {given!r}", key="scenario", expected=expected)
    return Scenario.load(given, known_trackers=TRACKERS)


@contextmanager
def _arguments() -> Iterator[None]:
    """Errors name the arguments of these functions, not the options of the command line."""
    try:
        yield
    except ScenarioError as error:
        if not error.key.startswith("--"):
            raise
        key = error.key.removeprefix("--")
        raise ScenarioError(error.what, file=error.file, key=key, expected=error.expected) from None
