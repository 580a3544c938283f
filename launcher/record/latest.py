"""Run folders by their age: ``latest`` is the newest finished run below ``runs/``, ``latest~1`` the one before it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Final

from launcher.files import MANIFEST, locked
from trackfield.errors import ScenarioError

RUNS: Final = Path("runs")
"""Where run folders go by default."""
LATEST: Final = "latest"
_LATEST: Final = re.compile(rf"{LATEST}(?:~(\d{{1,9}}))?")


def run_folder(name: str | Path) -> Path:
    """The folder of a run: ``latest``, ``latest~N`` (N runs before it), or a path as it is.

    Raises ``ScenarioError`` if there are not so many finished runs. A path is not checked here; a folder whose name is
    latest is ``./latest``.
    """
    asked = isinstance(name, str) and _LATEST.fullmatch(name)
    if not asked:
        return Path(name)
    back, runs = int(asked[1] or 0), finished()
    if back >= len(runs):
        many = f"there are {len(runs)} finished runs"
        found = {0: "there is no finished run", 1: "there is one finished run"}.get(len(runs), many)
        known = {0: "", 1: f"{LATEST} or "}.get(len(runs), f"{LATEST} to {LATEST}~{len(runs) - 1}, or ")
        raise ScenarioError(f"{found} below {RUNS}/", key=str(name), expected=f"{known}the folder of a run")
    return runs[back]


def going_on(below: Path = RUNS) -> list[Path]:
    """The folders of runs over processes that go on, the one that was started last first."""
    return [folder for _, folder in sorted(_started(below, over=False), reverse=True) if goes_on(folder)]


def goes_on(folder: Path) -> bool:
    """Whether a launcher is at work on the run in this folder."""
    try:
        with locked(folder):
            return False
    except BlockingIOError:
        return True
    except OSError:
        return False


def finished(below: Path = RUNS) -> list[Path]:
    """The folders of finished runs, the one that was started last first."""
    return [folder for _, folder in sorted(_started(below), reverse=True)]


def _started(below: Path, *, over: bool = True) -> Iterator[tuple[tuple[str, int], Path]]:
    """When each finished run was started: by its manifest, to the second, and within one by the age of that file.

    Unless ``over``, those that are not finished.
    """
    for manifest in below.glob(f"*/{MANIFEST}"):
        try:
            if not manifest.is_file() or manifest.with_name("metrics.json").is_file() != over:
                continue
            started = json.loads(manifest.read_bytes())["started"]
            datetime.fromisoformat(started)
            written_ns = manifest.stat().st_mtime_ns
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            continue  # not by ``reading``, which loads more than the completion of names can wait for
        yield (started, written_ns), manifest.parent
