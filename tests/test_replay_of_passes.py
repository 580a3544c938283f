"""A run with reports of passes fused again: events are over in the same steps, with the same fixes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest

from launcher.plan.prepare import load, planned
from launcher.record.folder import keep, prepare_folder
from launcher.run import run_virtual
from launcher.study.replay import replay

CENTRE = (
    *("architecture.kind=centralised", "camera.kind=none", "link.range_m=2000", "sensor.waveform=false"),
    "fusion.trackers=['ml','ecpa','ukf']",
)
LATE = ("link.model=gilbert_elliott", "link.delay_ms=200", "link.jitter_ms=900", "fusion.max_age_s=2.5")
IDEAL = ("link.model=ideal",)
DEAD = (
    "faults=[{kind='restart', nodes=['fusion'], at_s=14.4, until_s=17.7},"
    "{kind='restart', nodes=['fusion'], at_s=30.6, until_s=31.7}]"
)


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("launcher.run._report", lambda *_: "")


@pytest.mark.parametrize("settings", [IDEAL, LATE, (*IDEAL, DEAD), (*LATE, DEAD)])
def test_the_same_trackers_give_the_same_fixes(settings: Sequence[str]) -> None:
    """The second time the centre dies while an event is open: whatever it had gathered is gone."""
    scenario = load("yang-ecpa", settings=[*CENTRE, *settings])
    folder = prepare_folder(Path("run"), scenario.name, scenario.seed)
    keep(scenario, folder)
    run_virtual(planned(scenario), folder)
    before = pq.read_table(folder / "tracks.parquet")
    events = before.filter(pc.is_valid(before["event_ns"]))
    assert set(events["tracker"].to_pylist()) == {"ml", "ecpa", "ukf"}
    again = replay(folder, out=Path("again"))
    assert pq.read_table(again.folder / "tracks.parquet").equals(before)
