"""Runs of a study on disk: finished runs are not repeated, however the study ended.

A run is a file of its own, in a folder that is named after a digest of all that determines its figures: the resolved
scenario with the files that it names, the code that runs it, and numpy, whose random streams it draws from.
"""

from __future__ import annotations

import inspect
import json
import uuid
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from hashlib import blake2b
from importlib import import_module
from importlib.metadata import entry_points, version
from pathlib import Path
from typing import Any, Final

from launcher.files import check_text
from launcher.plan.extensions import own_places
from trackfield.errors import ScenarioError
from trackfield.filters.trackers import TRACKERS
from trackfield.scenario import Scenario
from trackfield.sensing.kinds import SENSORS

RESULTS: Final = "results"
_PACKAGES: Final = ("trackfield", "launcher.plan", "launcher.record")
"""The packages that determine a run's figures, besides those of the roles; all others only show them."""


@cache
def code_digest(*others: Path) -> str:
    """The digest of every source file that affects a run's figures, of ``others``, and of numpy's version."""
    roles = {entry.module.partition(".")[0] for entry in entry_points(group="trackfield.roles")}
    digest = blake2b(version("numpy").encode(), digest_size=8)
    for name in sorted({*_PACKAGES, *roles}):
        folder = Path(str(import_module(name).__file__)).parent
        for file in sorted(folder.rglob("*.py")):
            digest.update(f"{name}/{file.relative_to(folder)}".encode())
            digest.update(file.read_bytes())
    for file in others:
        digest.update(file.read_bytes())
    return digest.hexdigest()


def scenario_digest(scenario: Scenario, code: str = "") -> str:
    """The digest of a scenario without its seed: keys, contents of files, users' own classes; and of ``code``.

    The paths of files do not matter.
    """
    return blake2b((_contents_of(scenario) + _own_code(scenario) + code).encode(), digest_size=6).hexdigest()


def contents_digest(scenario: Scenario) -> str:
    """The digest of a scenario without its seed: keys, and contents of files."""
    return blake2b(_contents_of(scenario).encode(), digest_size=6).hexdigest()


def _contents_of(scenario: Scenario) -> str:
    said = _with_contents({key: value for key, value in scenario.plain().items() if key != "seed"})
    return json.dumps(said, sort_keys=True)


def _with_contents(value: Any) -> Any:
    """The same, with the contents of each file instead of its name."""
    if isinstance(value, Mapping):
        return {
            key: _contents(item) if key in ("file", "recording", "sound") else _with_contents(item)
            for key, item in value.items()
        }
    return [_with_contents(item) for item in value] if isinstance(value, list) else value


def _contents(file: object) -> str:
    try:
        return blake2b(Path(str(file)).read_bytes()).hexdigest()
    except OSError:
        return str(file)


def _own_code(scenario: Scenario) -> str:
    """The source of users' own trackers and sensors."""
    books = {plugins.kind: plugins for plugins in (TRACKERS, SENSORS)}
    named = (which.partition(":") for which in own_places(scenario))
    return "".join(_source(books[kind][name]) for kind, _, name in named)


def _source(maker: Any) -> str:
    """The text of the file that defines it; if there is none, a random one, so that no stored run matches."""
    try:
        return Path(str(inspect.getsourcefile(maker))).read_text(encoding="utf-8")
    except (OSError, TypeError):
        return uuid.uuid4().hex


class Store:
    """The runs of named scenarios below ``folder``; ``keys`` has the folder of each."""

    def __init__(self, folder: Path, keys: Mapping[str, str], suffix: str) -> None:
        self.folder, self.suffix = folder, suffix
        home = folder.absolute() / RESULTS  # workers may have been started elsewhere
        self._folders = {name: home / key for name, key in keys.items()}

    def file(self, name: str, seed: int) -> Path:
        """Where the run is, or will be."""
        return self._folders[name] / f"{seed:05}{self.suffix}"

    def missing(self, seeds: Sequence[int]) -> list[tuple[str, int]]:
        """The missing runs, seed by seed, so that an early end leaves about as many of each scenario."""
        return [(name, seed) for seed in seeds for name in self._folders if not self.file(name, seed).exists()]


def study_folder(folder: Path, kind: str = "study") -> None:
    """Make a folder for a study of this kind: new, empty, or one of an earlier study, which a file in it marks.

    Raises ``ScenarioError`` for any other folder, and changes nothing in it.
    """
    mark = folder / RESULTS / f".trackfield-{kind}"
    with writing(folder):
        check_text([str(folder.absolute())], "--out")
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()) and not mark.is_file():
            expected = f"an empty or new one, or that of an earlier {kind}"
            raise ScenarioError("the folder is not empty", file=str(folder), key="--out", expected=expected)
        mark.parent.mkdir(exist_ok=True)
        mark.touch()


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """Raise ``ScenarioError`` for what cannot be written below the folder of a study."""
    try:
        yield
    except OSError as error:
        what = f"cannot write there ({error.strerror})"
        file = str(error.filename or folder)
        raise ScenarioError(what, file=file, key="--out", expected="a writable folder") from None
