"""Many runs in virtual time, over all cores or a cluster, without their folders."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Final, TypeVar

import pyarrow as pa
import pyarrow.parquet as pq

from launcher.plan.extensions import Registered, register, registered
from launcher.plan.prepare import checked, planned
from launcher.record.bounds import run_bound
from launcher.record.folder import begin_folder, keep, prepare_folder
from launcher.record.measures import RunFigures
from launcher.record.metrics import run_metrics
from launcher.record.tables import tracks_table
from launcher.record.views import headline
from launcher.record.virtually import simulate
from launcher.run import run_virtual
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario

Job = TypeVar("Job")
Answer = TypeVar("Answer")

CHOSEN: Final = "median"
"""The folder of the run that a study leaves."""
_TYPES: Final = {
    "seed": pa.int64(),
    "tracker": pa.string(),
    "verdict": pa.string(),
    "lost": pa.bool_(),
    **dict.fromkeys(("steps", "steps_expected", "steps_tracked", "gap.steps"), pa.int64()),
    "nees_band": pa.list_(pa.float64()),
}
"""Of columns of a study's table; frames and bytes are whole numbers, all others not."""


@dataclass(frozen=True)
class StudyRun:
    """One run of a study: its seed, its figures, and its ``tracks`` as in tracks.parquet."""

    seed: int
    metrics: RunFigures
    tracks: pa.Table = field(repr=False)


@dataclass(frozen=True)
class Study:
    """Runs of one scenario, in the order of their seeds."""

    scenario: Scenario = field(repr=False)
    results: tuple[StudyRun, ...] = field(repr=False)

    def __repr__(self) -> str:
        return f"Study({self.scenario.name}, {len(self.results)} runs)"

    @cached_property
    def table(self) -> pa.Table:
        """A row for each seed and tracker; the columns are keys of metrics.json, like ``rmse.position``."""
        return figures_table(run.metrics for run in self.results)

    @property
    def median(self) -> StudyRun:
        """The run whose first tracker has the median RMSE of the position; no track at all counts as worst."""
        first = self.scenario.fusion.trackers[0]

        def error(run: StudyRun) -> float:
            position = run.metrics.trackers[first].rmse.position
            return float("inf") if position is None else position

        return sorted(self.results, key=error)[(len(self.results) - 1) // 2]


def study(scenario: Scenario, seeds: Iterable[int], n_jobs: int = -1, out: Path | None = None) -> Study:
    """Run the scenario with each of these seeds; ``out`` is for the tables and the median run.

    Raises ``ScenarioError`` if a run cannot be made, there are no seeds, or ``out`` is not empty.
    """
    runs = [checked(scenario, seed) for seed in seeds]
    if not runs:
        raise ScenarioError("there are none", key="seeds", expected="one or more, like range(100)")
    if out is not None:
        begin_folder(out, CHOSEN)
    found: dict[int, StudyRun] = dict(unordered(study_run, runs, n_jobs, f"{scenario.name}, {len(runs)} runs"))
    whole = Study(scenario, tuple(found[i] for i in range(len(runs))))
    if out is not None:
        _write(whole, out)
    return whole


def study_run(scenario: Scenario) -> StudyRun:
    """One run in virtual time, in this process: the figures of ``trackfield run --virtual``, but no folder."""
    begun, cpu_s = time.monotonic(), time.process_time()
    try:
        plan = planned(scenario)
    except ScenarioError as error:
        raise ScenarioError(f"with seed {scenario.seed}: {error}") from None
    ledger, rows = simulate(plan)
    bound = run_bound(plan, headline(plan, rows))
    metrics = run_metrics(plan, ledger, rows, bound)
    metrics |= {"driver": "virtual", "wall_s": time.monotonic() - begun, "cpu_s": time.process_time() - cpu_s}
    metrics["timing"]["speed"] = None
    metrics["recorder"]["messages"] = metrics["frames"]["sent"]
    return StudyRun(scenario.seed, RunFigures.of(metrics), tracks_table(rows, bound, plan.origin_ns))


def unordered(
    function: Callable[[Job], Answer], jobs: Sequence[Job], n_jobs: int = -1, title: str = ""
) -> Iterator[tuple[int, Answer]]:
    """(place in ``jobs``, answer) of each, as they come; with a progress bar on stderr where that is a terminal.

    ``n_jobs`` and ``joblib.parallel_config`` say where they are computed, as for ``joblib.Parallel``.
    """
    from joblib import Parallel, delayed

    calls = (delayed(_placed)(registered(), function, place, job) for place, job in enumerate(jobs))
    with _progress(title, len(jobs)) as advance:
        for answer in Parallel(n_jobs=n_jobs, return_as="generator_unordered")(calls):
            advance()
            yield answer


def figures_table(runs: Iterable[RunFigures]) -> pa.Table:
    """A row for each run and tracker, a column for each figure, named by its key in metrics.json."""
    rows = [row for run in runs for row in run.rows()]
    return pa.table({name: pa.array([row[name] for row in rows], _type(name)) for name in rows[0]})


def _type(name: str) -> pa.DataType:
    whole = name.startswith(("frames.", "bytes."))
    return _TYPES.get(name, pa.int64() if whole else pa.float64())


def _placed(brought: Registered, function: Callable[[Job], Answer], place: int, job: Job) -> tuple[int, Answer]:
    register(brought)  # what users registered they did so in the process that asked
    return place, function(job)


@contextmanager
def _progress(title: str, total: int) -> Iterator[Callable[[], Any]]:
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task(title, total=total)
        yield lambda: progress.advance(task)


def _write(whole: Study, out: Path) -> None:
    """study.parquet, tracks.parquet (with seeds), and the folder of the median run."""
    pq.write_table(whole.table, out / "study.parquet")
    tracks = [
        run.tracks.add_column(0, "seed", pa.array([run.seed] * len(run.tracks), pa.int64())) for run in whole.results
    ]
    pq.write_table(pa.concat_tables(tracks), out / "tracks.parquet")
    chosen = checked(whole.scenario, whole.median.seed)
    folder = prepare_folder(out / CHOSEN, chosen.name, chosen.seed)
    keep(chosen, folder)
    run_virtual(planned(chosen), folder)
