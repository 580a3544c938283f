"""Studies: a scenario, varied keys, and many runs of each combination in virtual time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from launcher.plan.prepare import checked
from launcher.study.axes import Axis, Design, design
from launcher.study.folder import StudyFolder
from launcher.study.parallel import unordered
from launcher.study.results import StudyRun, median_run, study_run, study_table
from launcher.study.store import writing
from launcher.study.summary import Summary, summary_of
from trackfield.errors import ScenarioError, TrackfieldError
from trackfield.scenario import Scenario

if TYPE_CHECKING:
    import pandas as pd

    from launcher.study.pictures.look import Picture


@dataclass(frozen=True)
class Study:
    """Runs of one scenario: combination by combination of the varied keys, each in the order of the seeds.

    ``folder`` is where the study is kept, if anywhere.
    """

    design: Design = field(repr=False)
    results: tuple[StudyRun, ...] = field(repr=False)
    folder: Path | None = None

    def __repr__(self) -> str:
        varied = f", {len(self.design.variants)} combinations" if self.axes else ""
        return f"Study({self.scenario.name}{varied}, {len(self.results)} runs)"

    @property
    def scenario(self) -> Scenario:
        """The scenario before any key is varied."""
        return self.design.scenario

    @property
    def axes(self) -> tuple[Axis, ...]:
        """The varied keys: ``key`` and ``values`` of each."""
        return self.design.axes

    @cached_property
    def table(self) -> pa.Table:
        """A row for each run and tracker; the columns are the varied keys, and keys of metrics.json."""
        return study_table(self.results, self.axes)

    @cached_property
    def summary(self) -> Summary:
        """The means of each combination and tracker, with intervals; ``summary.table`` has them as a table."""
        return summary_of(self.design, self.results)

    @property
    def median(self) -> StudyRun:
        """The run whose first tracker has the median RMSE of the position; no track at all counts as worst."""
        return median_run(self.results)

    def to_pandas(self) -> pd.DataFrame:
        """``table`` as a data frame. Raises ``TrackfieldError`` where pandas is not installed."""
        try:
            import pandas  # noqa: F401
        except ImportError:
            said = "to_pandas needs pandas, which is not installed; pip install 'trackfield[notebook]' brings it"
            raise TrackfieldError(said) from None
        return self.table.to_pandas()

    def plot(self, axis: str | None = None) -> Picture:
        """The effect of a varied key (default: the first) on error, latency, energy, lifetime and losses.

        A matplotlib figure, which notebooks show. If nothing is varied, trackers are compared. Raises
        ``ScenarioError`` for a key that is not varied.
        """
        from launcher.study.pictures.drawing import axis_of
        from launcher.study.pictures.effects import axis_picture

        return axis_picture(self.summary, axis_of(self.summary, axis))

    def pareto(self, x: str = "", y: str = "") -> Picture:
        """Two figures (keys of metrics.json) of each combination, and the best of them; default: cost and error.

        A matplotlib figure, which notebooks show. Raises ``ScenarioError`` for what is no figure of a study, or is the
        same twice, and where no run has both.
        """
        from launcher.study.figures import check_figure
        from launcher.study.pictures.pareto import default_pair, front_of, pareto_picture

        usual = default_pair(self.summary)
        x, y = x or usual[0], y or usual[1]
        for figure, key in ((x, "x"), (y, "y")):
            check_figure(figure, key)
        if x == y:
            raise ScenarioError(f"both are {x}", key="x, y", expected="two figures")
        front = front_of(self.summary, x, y)
        if front.empty:
            raise ScenarioError(front.empty, key="x, y", expected="two figures that some run has")
        return pareto_picture(front)

    def _repr_html_(self) -> str:
        from launcher.study.table import html_table

        return f"<p><b>{self.scenario.name}</b>: {len(self.results)} runs</p>{html_table(self.summary)}"


def study(
    scenario: Scenario,
    seeds: Iterable[int],
    vary: Mapping[str, Iterable[Any]] | None = None,
    *,
    n_jobs: int = -1,
    out: Path | None = None,
) -> Study:
    """Run every combination of the varied keys with each of these seeds; ``out`` is the folder of the study.

    Raises ``ScenarioError`` if a run cannot be made, there are no seeds, or ``out`` has other contents.
    """
    whole = design(scenario, seeds, vary)
    if out is None:
        return _unkept(whole, n_jobs)
    folder = StudyFolder(out, whole)
    folder.begin([])
    fill(folder, n_jobs)
    return finish(folder)


def _unkept(whole: Design, n_jobs: int) -> Study:
    """All runs, in memory."""
    jobs = whole.jobs
    found: dict[int, StudyRun] = dict(unordered(_run, _given(whole, jobs), n_jobs, _title(whole)))
    runs = (found[i].of(whole.variants[place].values) for i, (place, _) in enumerate(jobs))
    return Study(whole, tuple(runs))


def fill(folder: StudyFolder, n_jobs: int = -1, *, lines: bool = False) -> None:
    """Do the runs that are missing in the folder; finished ones are kept, however this ends."""
    jobs = folder.missing()
    given = _given(folder.design, jobs)
    for number, run in unordered(_run, given, n_jobs, _title(folder.design), lines=lines):
        with writing(folder.path):
            run.save(folder.file(*jobs[number]))


def finish(folder: StudyFolder, pareto: tuple[str, str] | None = None) -> Study:
    """The study, once all runs are there; writes tables, pictures and a page into its folder."""
    from launcher.study.page import write_page

    runs = tuple(folder.load(place, seed) for place, seed in folder.design.jobs)
    whole = Study(folder.design, runs, folder.path)
    with writing(folder.path):
        folder.write_tables(runs, whole.summary)
        write_page(folder, runs, whole.summary, pareto)
        if whole.axes:
            folder.remove_median()
        else:
            folder.write_median(whole.median)
    return whole


def _given(whole: Design, jobs: Sequence[tuple[int, int]]) -> list[tuple[Scenario, int]]:
    return [(whole.variants[place].scenario, seed) for place, seed in jobs]


def _run(given: tuple[Scenario, int]) -> StudyRun:
    return study_run(checked(*given))


def _title(whole: Design) -> str:
    return f"{whole.scenario.name}, {len(whole.jobs)} runs"
