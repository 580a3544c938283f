"""The runs of a paper's cases on disk (``launcher/study/store.py``)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from launcher.reproduce import records
from launcher.reproduce.case import Case
from launcher.reproduce.records import Record, measure
from launcher.study import store
from launcher.study.parallel import unordered
from launcher.study.store import scenario_digest


def code_digest() -> str:
    """The digest of every source file that affects the figures of a case."""
    return store.code_digest(Path(records.__file__))


class Store(store.Store):
    """The runs of some cases below ``folder``, each in a folder that is named after its case and a digest."""

    def __init__(self, folder: Path, cases: Sequence[Case]) -> None:
        self.cases = {case.name: case for case in cases}
        code = code_digest()
        keys = {case.name: f"{case.name}-{scenario_digest(case.scenario(0), code)}" for case in cases}
        super().__init__(folder, keys, ".npz")

    def fill(self, runs: Sequence[tuple[str, int]]) -> Iterator[None]:
        """Do these runs on all cores; yields after each that is on disk."""
        jobs = [(self.cases[case], seed) for case, seed in runs]
        for number, record in unordered(_run, jobs, title=f"{len(jobs)} runs", lines=True):
            record.save(self.file(*runs[number]))
            yield

    def records(self, case: str, seeds: Sequence[int]) -> list[Record]:
        """The case's runs, which must exist."""
        return [Record.load(self.file(case, seed)) for seed in seeds]


def _run(job: tuple[Case, int]) -> Record:
    return measure(*job)
