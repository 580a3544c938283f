"""Run folders: begun empty, with a manifest, and with the files that make the run again."""

from __future__ import annotations

import platform
import shutil
from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

import psutil

from launcher.record.journal import write_json
from launcher.record.latest import RUNS
from launcher.records import Plan
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario
from trackfield.scenario.layouts import Surveyed
from trackfield.scenario.links import Trace
from trackfield.scenario.paths import FromFile


def prepare_folder(out: Path | None, scenario: str, seed: int, below: Path = RUNS) -> Path:
    """An empty folder for the run: ``out``, or one ``below``. Raises ``ScenarioError`` as ``begin_folder`` does."""
    stamp = datetime.now().strftime("%Y%m%dT%H%M%S.%f")[:-3]
    folder = out or below / f"{scenario}-{seed}-{stamp}"
    begin_folder(folder, "logs")
    return folder


def begin_folder(folder: Path, inside: str) -> None:
    """A folder with an empty one inside. Raises ``ScenarioError`` if it has something in it or cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if any(folder.iterdir()):
            raise ScenarioError(
                "the folder has something in it",
                file=str(folder),
                key="--out",
                expected="an empty or new one",
            )
        (folder / inside).mkdir()
    except OSError as error:
        raise ScenarioError(
            f"cannot write there ({error.strerror})",
            file=str(folder),
            key="--out",
            expected="a writable folder",
        ) from None


def write_manifest(folder: Path, plan: Plan, command: Sequence[str], endpoint: str | None) -> None:
    """What ``manifest`` has; ``run`` and ``endpoint`` are what others join the run by."""
    write_json({**manifest(command), "run": plan.run.run, "endpoint": endpoint}, folder / "manifest.json")


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
    """Write ``scenario.toml`` into the run folder, and beside it the files that it names: to be run again anywhere."""
    (folder / "scenario.toml").write_text(with_files(scenario, folder).to_toml(), encoding="utf-8")


def with_files(scenario: Scenario, folder: Path, prefix: str = "") -> Scenario:
    """The scenario with copies in the folder of the files that it names, called by what they are."""
    for section, name in (("target", "target"), ("field", "sensors"), ("link", "link")):
        copied = _kept(getattr(scenario, section), folder, prefix + name)
        scenario = scenario.model_copy(update={section: copied})
    first = scenario.every_target[0]
    names = [f"{prefix}target{'' if one is first else f'-{one.id}'}" for one in scenario.targets]
    targets = tuple(_kept(one, folder, name) for one, name in zip(scenario.targets, names, strict=True))
    return scenario.model_copy(update={"targets": targets})


def _kept(part: Any, folder: Path, name: str) -> Any:
    """A section whose file is the copy made of it in the folder; one that names no file as it is."""
    if not isinstance(part, FromFile | Surveyed | Trace):
        return part
    file = Path(part.file)
    copy = folder / f"{name}{file.suffix}"
    if not copy.exists() or not copy.samefile(file):  # a study's folder may be given its own scenario again
        shutil.copyfile(file, copy)
    return part.model_copy(update={"file": copy.name})
