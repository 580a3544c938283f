"""The folder of a study: its runs, which are not repeated, and the results made from them."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pq
from pydantic import BaseModel

from launcher.files import MANIFEST, SCENARIO, TRACKS_TABLE
from launcher.nested import flat
from launcher.plan.prepare import checked, planned
from launcher.record.folder import keep, manifest, prepare_folder
from launcher.record.journal import write_json
from launcher.run import run_virtual
from launcher.study.axes import Design, label
from launcher.study.results import StudyRun, damaged, study_table, write_tracks
from launcher.study.store import RESULTS, Store, code_digest, scenario_digest, study_folder, writing
from launcher.study.summary import Summary
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario

CHOSEN: Final = "median"
"""The run folder in a study in which nothing is varied."""
MOST_CHANGES: Final = 3


class _Study(BaseModel):
    """What was run, as ``StudyFolder`` writes it."""

    scenario: str
    seeds: list[int]
    vary: dict[str, list[Any]]
    code: str


class _Before(BaseModel):
    """The manifest of an earlier study in the folder."""

    study: _Study


class StudyFolder:
    """A study below ``path``. Raises ``ScenarioError`` for a folder with other contents."""

    def __init__(self, path: Path, design: Design) -> None:
        study_folder(path)
        self.path, self.design = path, design
        code = code_digest()
        keys = {str(place): scenario_digest(one.scenario, code) for place, one in enumerate(design.variants)}
        self._store = Store(path, keys, ".parquet")
        self._study: dict[str, Any] = {
            "scenario": scenario_digest(design.scenario),
            "seeds": list(design.seeds),
            "vary": {axis.key: list(axis.values) for axis in design.axes},
            "code": code,
        }

    def missing(self) -> list[tuple[int, int]]:
        """(place of the variant, seed) of the runs that are missing."""
        return [(int(name), seed) for name, seed in self._store.missing(self.design.seeds)]

    def file(self, place: int, seed: int) -> Path:
        """Where a run is, or will be."""
        return self._store.file(str(place), seed)

    def load(self, place: int, seed: int) -> StudyRun:
        """A run that is there, with the values of its variant."""
        file, variant = self.file(place, seed), self.design.variants[place]
        run = StudyRun.load(file)
        if (run.metrics.scenario, run.seed) != (variant.scenario.name, seed):
            raise damaged(file, "is another run")
        return run.of(variant.values)

    def scenario_file(self, place: int) -> Path:
        """The scenario file of a variant: what runs it again, anywhere."""
        return self.path / RESULTS / self.file(place, 0).parent.name / SCENARIO

    def begin(self, command: Sequence[str]) -> list[str]:
        """Write what is to be run; returns how it differs from the study in the folder, in sentences."""
        said = list(self._changes())
        with writing(self.path):
            self.path.joinpath(SCENARIO).unlink(missing_ok=True)
            keep(self.design.scenario, self.path)
            for place, variant in enumerate(self.design.variants):
                if not self.scenario_file(place).exists():
                    self.scenario_file(place).parent.mkdir(exist_ok=True)
                    keep(variant.scenario, self.scenario_file(place).parent)
            write_json({**manifest(command), "study": self._study}, self.path / MANIFEST)
        return said

    # --- what changed -------------------------------------------------------------------------------------------------

    def _changes(self) -> Iterator[str]:
        if not (self.path / MANIFEST).exists():
            return
        try:
            before = _Before.model_validate_json((self.path / MANIFEST).read_bytes()).study.model_dump(mode="json")
        except (OSError, ValueError):
            yield f"{MANIFEST} is damaged: whether this is the study that was in the folder is not known"
            return
        if before["code"] != self._study["code"]:
            yield "the code of Trackfield has changed since the runs in this folder, which are made again"
        if before["scenario"] != self._study["scenario"]:
            yield f"the scenario differs from that of the study in this folder: {self._changed_keys()}"
        if before["vary"] != self._study["vary"]:
            yield f"the study varied {_varied(before['vary'])}, and now varies {_varied(self._study['vary'])}"
        if before["seeds"] != self._study["seeds"]:
            yield f"the seeds were {seeds_in_words(before['seeds'])}, and are now {seeds_in_words(self.design.seeds)}"

    def _changed_keys(self) -> str:
        """The keys of the scenario that have changed, with their values before and now."""
        try:
            old = flat(Scenario.load(self.path / SCENARIO).plain())
        except ScenarioError:
            return "its old file can no longer be read"
        new = flat(self.design.scenario.plain())
        keys = [key for key in dict.fromkeys((*old, *new)) if old.get(key) != new.get(key) and key != "seed"]
        keys = [key for key in keys if not key.endswith("file")] or keys
        told = [f"{key} was {label(old.get(key, 'unset'))} and is {label(new.get(key, 'unset'))}" for key in keys]
        more = f", and {len(told) - MOST_CHANGES} more keys" if len(told) > MOST_CHANGES else ""
        return (", ".join(told[:MOST_CHANGES]) or "its files or trackers differ") + more

    # --- results of the runs ------------------------------------------------------------------------------------------

    def write_tables(self, runs: Sequence[StudyRun], summary: Summary) -> None:
        """study.parquet, study.csv, summary.csv and tracks.parquet."""
        table = study_table(runs, self.design.axes)
        pq.write_table(table, self.path / "study.parquet")
        _write_csv(table, self.path / "study.csv")
        _write_csv(summary.table, self.path / "summary.csv")
        write_tracks(runs, self.design.axes, self.path / TRACKS_TABLE)

    def remove_median(self) -> None:
        """That of an earlier study in this folder."""
        shutil.rmtree(self.path / CHOSEN, ignore_errors=True)

    def write_median(self, run: StudyRun) -> None:
        """The run folder of one run, with timeline and report."""
        self.remove_median()
        chosen = checked(self.design.scenario, run.seed)
        folder = prepare_folder(self.path / CHOSEN, chosen.name, chosen.seed)
        keep(chosen, folder)
        if run_virtual(planned(chosen), folder).signal is not None:
            raise KeyboardInterrupt


def _write_csv(table: pa.Table, file: Path) -> None:
    """Write CSV, with lists as text."""
    for place, name in enumerate(table.column_names):
        if pa.types.is_list(table[name].type):
            said = [None if value is None else label(value) for value in table[name].to_pylist()]
            table = table.set_column(place, name, pa.array(said, pa.string()))
    pa_csv.write_csv(table, file)


def _varied(vary: Mapping[str, Sequence[Any]]) -> str:
    return "; ".join(f"{key} = {', '.join(map(label, values))}" for key, values in vary.items()) or "nothing"


def seeds_in_words(seeds: Sequence[int]) -> str:
    """1 to 20, or the seeds one by one."""
    if len(seeds) > 2 and list(seeds) == list(range(seeds[0], seeds[-1] + 1)):
        return f"{seeds[0]} to {seeds[-1]}"
    return ", ".join(map(str, seeds))


def default_folder(design: Design) -> Path:
    """Below ``runs/``: named after the scenario, with a digest of it and of the varied keys, so that a study with more
    seeds or values continues in the same folder, and one of another scenario gets its own."""
    digest = scenario_digest(design.scenario, ",".join(axis.key for axis in design.axes))
    return Path("runs") / f"study-{design.scenario.name}-{digest[:6]}"
