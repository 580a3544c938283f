"""Planned faults of containers in a real field, where an engine is."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from tests.containers import SCENARIO, Field, image
from tests.running import PATIENCE_S

__all__ = ["image"]
SCRIPT = Path(__file__).parents[1] / "containers" / "faults.py"
KILLED, RESTARTED, PAUSED_SHORT, PAUSED, CUT = "n003", "n004", "n005", "n006", "n007"
FAULTS = (
    f"{{kind='container-kill',nodes=['{KILLED}'],at_s=8}}",
    f"{{kind='container-restart',nodes=['{RESTARTED}'],at_s=8,until_s=14}}",
    f"{{kind='container-pause',nodes=['{PAUSED_SHORT}'],at_s=10,until_s=14}}",
    f"{{kind='container-pause',nodes=['{PAUSED}'],at_s=10,until_s=26}}",
    f"{{kind='container-disconnect',nodes=['{CUT}'],at_s=10,until_s=26,network='field'}}",
)
"""Of those that are away for more than ten seconds Zenoh gives up the session."""
SMALL = "spcpf --nodes 4 --set sensor.threshold=0.5 --set target.steps=30 --set energy.battery_j=0.15"
"""Batteries that last for about 20 s."""

pytestmark = pytest.mark.timeout(900)


@dataclass
class Struck:
    """A run with planned faults of containers: how it ended, its folder, and what was left standing still."""

    code: int
    said: str
    folder: Path
    still: list[str]

    @property
    def metrics(self) -> dict[str, Any]:
        return json.loads((self.folder / "metrics.json").read_text())  # type: ignore[no-any-return]

    @property
    def log(self) -> list[str]:
        return (self.folder / "containers.log").read_text().splitlines()

    @property
    def places(self) -> dict[str, str]:
        return json.loads((self.folder / "places.json").read_text())["places"]  # type: ignore[no-any-return]

    def rows(self, id: str) -> list[dict[str, Any]]:
        """What this process sent."""
        return [one for one in pq.read_table(self.folder / "messages.parquet").to_pylist() if one["src"] == id]


@contextmanager
def struck(image: str, runs: Path, scenario: str, *faults: str, **containers: int) -> Iterator[Struck]:
    field = Field(image, runs, f'{scenario} --set "faults=[{",".join(faults)}]"')
    script = subprocess.Popen([sys.executable, SCRIPT, runs])
    try:
        field.up(**containers)
        field.launch()
        code = field.finish()
        assert list(runs.glob("*/metrics.json")), field.said()
        assert script.wait(PATIENCE_S) == 0
        still = [line for line in field.labelled("ps", "--filter=status=paused") if line]
        [folder] = (path for path in runs.iterdir() if path.is_dir())
        yield Struck(code, field.said(), folder, still)
    finally:
        script.terminate()
        script.wait()
        field.down()


@pytest.fixture(scope="module")
def seen(image: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Struck]:
    with struck(image, tmp_path_factory.mktemp("runs"), SCENARIO, *FAULTS, node=25, fusion=1) as one:
        yield one


def test_planned_faults_do_not_make_the_run_fail(seen: Struck) -> None:
    assert seen.code == 0, seen.said
    metrics = seen.metrics
    assert metrics["complete"]
    assert (metrics["processes"]["died"], metrics["processes"]["stopped"]) == ([], [])
    assert set(metrics["interference"].values()) == {0}
    assert metrics["recorder"] | {"messages": 0} == {"messages": 0, "dropped": 0, "complaints": []}


def test_each_is_brought_about_no_earlier_than_planned(seen: Struck) -> None:
    found = [
        re.fullmatch(r"\S+ of (\S+) at (\S+) s( ends)?: docker .*, from (\S+) s to (\S+) s", one) for one in seen.log
    ]
    begun = {(one[1], bool(one[3])): float(one[4]) for one in found if one}
    planned = {
        (KILLED, False): 8.0,
        (RESTARTED, False): 8.0,
        (RESTARTED, True): 14.0,
        (PAUSED_SHORT, False): 10.0,
        (PAUSED_SHORT, True): 14.0,
        (PAUSED, False): 10.0,
        (PAUSED, True): 26.0,
        (CUT, False): 10.0,
        (CUT, True): 26.0,
    }
    assert begun.keys() == planned.keys(), seen.log
    assert all(begun[one] >= planned[one] for one in planned)


def test_one_that_is_killed_says_no_more(seen: Struck) -> None:
    assert max(row["sent_ns"] for row in seen.rows(KILLED)) < 10e9


def test_one_that_starts_again_has_its_place_again(seen: Struck) -> None:
    rows = seen.rows(RESTARTED)
    assert {row["incarnation"] for row in rows} == {0, 1}
    assert min(row["sent_ns"] for row in rows if row["incarnation"]) >= 14e9


def test_those_that_were_away_are_back_and_what_was_lost_meanwhile_is_counted_as_planned(seen: Struck) -> None:
    for id in (PAUSED, CUT):
        assert max(row["sent_ns"] for row in seen.rows(id)) > 50e9
    frames = seen.metrics["frames"]
    assert frames["lost"]["container"] > 0
    assert frames["host_lost"] == 0
    assert frames["expected"] == frames["delivered"] + sum(frames["lost"].values()) + frames["host_late"]


def test_the_report_tells_of_them(seen: Struck) -> None:
    page = (seen.folder / "report.html").read_text()
    assert "container-restart until 14 s" in page
    assert "containers.log" in page


def test_a_container_that_starts_again_has_what_is_left_of_its_battery(image: str, tmp_path: Path) -> None:
    restart = "{kind='container-restart',nodes=['n001'],at_s=11,until_s=13}"
    endless = "{kind='container-pause',nodes=['n002'],at_s=10,until_s=100}"
    with struck(image, tmp_path, SMALL, restart, endless, node=4, fusion=1) as one:
        assert one.code == 0, one.said
        empty = {battery["id"]: battery["t"] for battery in one.metrics["lifetime_s"]["empty"]}
        assert empty["n003"] < empty["n001"] < 13 + empty["n003"] - 5  # it says every 5 s what it has spent
        assert {row["incarnation"] for row in one.rows("n001")} == {0, 1}
        assert one.still == []
