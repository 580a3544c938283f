"""Run folders: created empty, with a manifest and the files that repeat the run."""

from __future__ import annotations

import os
import platform
import shutil
import tomllib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from errno import EACCES, ENOTDIR
from hashlib import blake2b
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import psutil

from launcher.files import MANIFEST, SCENARIO, check_text, patiently, write_whole
from launcher.record.journal import METRICS, write_json
from launcher.record.latest import RUNS
from launcher.record.reading.files import read_manifest
from launcher.records import Plan
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario
from trackfield.scenario.layouts import Surveyed
from trackfield.scenario.links import Trace
from trackfield.scenario.paths import FromFile, PathSection, Recorded
from trackfield.scenario.scenario import FILES
from trackfield.scenario.sensors import SensorSection

_COPIES: Final = {
    "target": "target",
    "targets": "target",
    "field": "sensors",
    "sensor": "recording",
    "sensors": "recording",
    "link": "link",
    "backbone": "backbone",
}
"""The sections that can name a file, and what its copy is called."""


def prepare_folder(out: Path | None, scenario: str, seed: int, below: Path = RUNS) -> Path:
    """An empty folder for the run: ``out``, or one ``below``. Raises ``ScenarioError`` as ``begin_folder`` does."""
    stamp = datetime.now().strftime("%Y%m%dT%H%M%S.%f")[:-3]
    folder = out or below / f"{scenario}-{seed}-{stamp}"
    begin_folder(folder, "logs")
    return folder


def begin_folder(folder: Path, inside: str) -> None:
    """A folder with an empty one inside. Raises ``ScenarioError`` if it is not empty or cannot be written."""
    with _writing(folder):
        check_text([str(folder.absolute())], "--out")
        folder.mkdir(parents=True, exist_ok=True)
        _check_empty(folder)
        (folder / inside).mkdir()


def check_folder(folder: Path) -> None:
    """Raise ``ScenarioError`` as ``begin_folder`` would; nothing is written."""
    with _writing(folder):
        check_text([str(folder.absolute())], "--out")
        there = next(one for one in (folder, *folder.absolute().parents) if one.exists())
        if there == folder:
            _check_empty(folder)
        elif not there.is_dir():
            raise NotADirectoryError(ENOTDIR, os.strerror(ENOTDIR))
        if not os.access(there, os.W_OK):
            raise PermissionError(EACCES, os.strerror(EACCES))


@contextmanager
def whole_or_none(folder: Path) -> Iterator[None]:
    """Remove the folder if filling it is interrupted, unless the run in it is over."""
    try:
        yield
    except KeyboardInterrupt:
        if not (folder / METRICS).exists():
            shutil.rmtree(folder, ignore_errors=True)
        raise


@contextmanager
def _writing(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        what = f"cannot write there ({error.strerror})"
        raise ScenarioError(what, file=str(folder), key="--out", expected="a writable folder") from None


def _check_empty(folder: Path) -> None:
    if any(folder.iterdir()):
        what = "the folder is not empty"
        raise ScenarioError(what, file=str(folder), key="--out", expected="an empty or new one")


def write_manifest(folder: Path, plan: Plan, command: Sequence[str], endpoint: str | None) -> None:
    """Write what ``manifest`` has, the warnings, and what others need to join the run: ``run`` and ``endpoint``.

    To make its tables again, its ``speed``, the digest of its ``scenario`` and its ``bridges`` are there, too.
    """
    told = {"run": plan.run.run, "endpoint": endpoint, "warnings": list(plan.warnings)}
    again = {"speed": plan.run.speed, "scenario": scenario_digest(folder), "bridges": dict(plan.bridges)}
    content = {**manifest(command), **told, **again}
    patiently(lambda: write_json(content, folder / MANIFEST), str(folder / MANIFEST))


def manifest(command: Sequence[str]) -> dict[str, Any]:
    """Versions, machine and command."""
    packages = ("trackfield", "eclipse-zenoh", "numpy", "scipy", "rerun-sdk")
    return {
        "command": list(command),
        "started": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": {"python": platform.python_version(), **{p: version(p) for p in packages}},
        "machine": {
            "system": platform.platform(),
            "cores": psutil.cpu_count(),
            "memory_gb": round(psutil.virtual_memory().total / 1e9, 1),
        },
    }


def keep(scenario: Scenario, folder: Path) -> None:
    """Write ``scenario.toml`` and the files that it names into the run folder, so that it can run again anywhere."""
    file = folder / SCENARIO
    patiently(lambda: write_whole(file, with_files(scenario, folder).to_toml()), str(file))


def with_files(scenario: Scenario, folder: Path, prefix: str = "") -> Scenario:
    """The scenario with copies of the files that it names in the folder, named after their sections."""
    first, copied = scenario.every_target[0], {}
    for section, name in _COPIES.items():
        part = getattr(scenario, section)
        if isinstance(part, tuple):
            ends = ["" if one is first else f"-{getattr(one, 'id', number)}" for number, one in enumerate(part, 1)]
            copied[section] = tuple(
                _kept(one, folder, prefix + name + end) for one, end in zip(part, ends, strict=True)
            )
        else:
            copied[section] = _kept(part, folder, prefix + name)
    return scenario.model_copy(update=copied)


def _kept(part: Any, folder: Path, name: str) -> Any:
    """The section with copies of its files in the folder; unchanged if it names none."""
    copies = {}
    for key in _file_keys(part):
        file = Path(getattr(part, key))
        copy = folder / f"{name}{'-sound' if key == 'sound' else ''}{file.suffix}"
        if not copy.exists() or not copy.samefile(file):  # a study may be run again from its own scenario file
            shutil.copyfile(file, copy)
        copies[key] = copy.name
    return part.model_copy(update=copies) if copies else part


def _file_keys(part: Any) -> list[str]:
    """Which keys of a section name a file; others may have an option that is called so."""
    named = {
        "file": isinstance(part, FromFile | Surveyed | Trace),
        "recording": isinstance(part, Recorded | SensorSection) and part.recording,
        "sound": isinstance(part, PathSection) and part.sound,
    }
    return [key for key, names in named.items() if names]


def scenario_digest(folder: Path) -> str:
    """Of the scenario in a run folder, empty if there is none. Raises ``ValueError`` if a file is missing."""
    toml = folder / SCENARIO
    if not toml.is_file():
        return ""
    content = toml.read_bytes()
    digest = blake2b(content, digest_size=16)
    for name in sorted(set(_files(tomllib.loads(content.decode())))):
        copy = folder / name
        if copy.parent != folder or not copy.is_file():
            raise ValueError(f"{name} is not in the folder")
        digest.update(name.encode() + b"\0" + copy.read_bytes())
    return digest.hexdigest()


def check_scenario(folder: Path) -> None:
    """Raise ``ScenarioError`` unless the scenario in a run folder is the one that ran."""
    ran = read_manifest(folder).scenario
    try:
        found = scenario_digest(folder)
    except (OSError, ValueError, RecursionError):
        found = ""
    if not ran or found != ran:
        what = "is not the scenario of this run: it, or a file that it names, was changed afterwards"
        expected = f"it as it was; trackfield run {folder / SCENARIO} runs the changed one"
        raise ScenarioError(what, file=str(folder / SCENARIO), expected=expected)


def _files(settings: dict[str, Any]) -> Iterator[str]:
    """The files that a scenario names, in the sections that can."""
    for section in _COPIES:
        found = settings.get(section)
        for part in found if isinstance(found, list) else [found]:
            if isinstance(part, dict):
                yield from (part[key] for key in FILES[section] if isinstance(part.get(key), str))
