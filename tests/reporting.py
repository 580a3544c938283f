"""Short runs with a report, and readers of what it says."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from launcher import report
from launcher.plan.prepare import load, planned
from launcher.record.folder import keep
from launcher.report.folder import Run, read_run
from launcher.run import run_virtual

FAULTS = (
    "faults=[{kind='kill', nodes=['n036'], at_s=4}, {kind='partition', nodes=['n024'], at_s=2, until_s=6}, "
    "{kind='freeze', nodes=['n001', 'n002'], at_s=1, until_s=3}]"
)


def run(folder: Path, *settings: str, scenario: str = "spcpf", steps: int = 12) -> Path:
    """The folder of a short virtual run."""
    (folder / "logs").mkdir(parents=True)
    resolved = load(scenario, settings=[f"target.steps={steps}", *settings])
    keep(resolved, folder)
    outcome = run_virtual(planned(resolved), folder, ["trackfield", "run", scenario, "--virtual"])
    assert (outcome.unreported, outcome.exit_code) == ("", 0)
    return folder


@pytest.fixture(scope="module")
def troubled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Lossy, with clocks that are off, small batteries and faults."""
    settings = ("link.model=fixed", "link.loss=0.2", "clock.offset_ms=20", "energy.battery_j=0.06", FAULTS)
    return run(tmp_path_factory.mktemp("troubled"), *settings)


@pytest.fixture
def copied(troubled: Path, tmp_path: Path) -> Path:
    """A copy, to be spoilt."""
    return Path(shutil.copytree(troubled, tmp_path / "copy"))


class Reader(HTMLParser):
    """What a page refers to, and the text of its elements."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


def read(folder: Path) -> Reader:
    return Reader((folder / report.PAGE).read_text())


def changed(folder: Path, change: Callable[[dict[str, Any]], object]) -> Run:
    """The run with other metrics."""
    file = folder / "metrics.json"
    metrics = json.loads(file.read_text())
    change(metrics)
    file.write_text(json.dumps(metrics))
    return read_run(folder)


def with_tracks(folder: Path, change: Callable[[pa.Table], pa.Table]) -> None:
    pq.write_table(change(pq.read_table(folder / "tracks.parquet")), folder / "tracks.parquet")
