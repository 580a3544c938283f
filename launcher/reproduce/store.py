"""A study's runs on disk: what is there is not run again, whatever ended the study.

A run is a file of its own, in a folder that is named after its case and a digest of all that decides its figures:
the resolved scenario, the code that runs it, and numpy, whose random streams it draws from.
"""

from __future__ import annotations

import json
import signal
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from hashlib import blake2b
from importlib import import_module
from importlib.metadata import entry_points, version
from pathlib import Path
from typing import Final

from launcher.reproduce import records
from launcher.reproduce.case import Case
from launcher.reproduce.records import Record, measure
from launcher.study.studies import unordered

RESULTS: Final = "results"
_PACKAGES: Final = ("trackfield", "launcher.plan", "launcher.record")
"""That decide a run's figures, besides those of the roles; the other rooms only show them."""


@cache
def code_digest() -> str:
    """Of every source file that has a say in a run's figures, and of numpy's version."""
    roles = {entry.module.partition(".")[0] for entry in entry_points(group="trackfield.roles")}
    digest = blake2b(version("numpy").encode(), digest_size=8)
    for name in sorted({*_PACKAGES, *roles}):
        folder = Path(str(import_module(name).__file__)).parent
        for file in sorted(folder.rglob("*.py")):
            digest.update(f"{name}/{file.relative_to(folder)}".encode())
            digest.update(file.read_bytes())
    digest.update(Path(records.__file__).read_bytes())
    return digest.hexdigest()


class Store:
    """The runs of some cases below ``folder``."""

    def __init__(self, folder: Path, cases: Sequence[Case]) -> None:
        self.folder = folder
        self.cases = {case.name: case for case in cases}
        home = folder.absolute() / RESULTS  # workers may have been started elsewhere
        self._folders = {case.name: home / f"{case.name}-{_key(case)}" for case in cases}

    def file(self, case: str, seed: int) -> Path:
        """Where the run is, or will be."""
        return self._folders[case] / f"{seed:05}.npz"

    def missing(self, seeds: Sequence[int]) -> list[tuple[str, int]]:
        """The runs that are not there, seed by seed: an early end leaves all cases about as far."""
        return [(case, seed) for seed in seeds for case in self.cases if not self.file(case, seed).exists()]

    def fill(self, runs: Sequence[tuple[str, int]]) -> Iterator[None]:
        """Do these runs on all cores; yields after each that is on disk."""
        jobs = [(self.cases[case], seed, self.file(case, seed)) for case, seed in runs]
        for _ in unordered(_run, jobs, title=f"{len(jobs)} runs"):
            yield

    def records(self, case: str, seeds: Sequence[int]) -> list[Record]:
        """The case's runs, which have to be there."""
        return [Record.load(self.file(case, seed)) for seed in seeds]


def _run(job: tuple[Case, int, Path]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the study's to answer
    case, seed, file = job
    measure(case, seed).save(file)


def _key(case: Case) -> str:
    plain: Mapping[str, object] = case.scenario(0).plain()
    said = json.dumps(plain, sort_keys=True) + code_digest()
    return blake2b(said.encode(), digest_size=6).hexdigest()
