"""The stranger's architecture of docs/extending.md: two centres, and a base that knows their tracks by radio alone."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trackfield as tf
from launcher.plan.architectures import ARCHITECTURES
from launcher.plan.prepare import planned
from launcher.study.compare import differences
from tests.rrd import entities
from tests.running import SPEEDS, kept_up
from tests.test_extending_docs import EXAMPLES
from trackfield.drivers.engine.core import Core
from trackfield.drivers.engine.frames import Arrival

HARD = {
    "link.tx_dbm": 13.0,  # many links carry some of their messages
    "run.setup_s": 5.0,
    "clock.offset_ms": 20.0,
    "clock.drift_ppm": 20.0,
    "energy.battery_j": 40.0,
    "energy.centre_battery_j": 2000.0,
    "fusion.trackers": ["imm-ukf", "ekf"],
    "faults": [{"kind": "kill", "nodes": ["west"], "at_s": 12}],
    "target.steps": 24,
}
"""Radio, clocks, batteries, and a centre that is killed while the target is in its half."""


@pytest.fixture(autouse=True)
def two_centres(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The example of the document, as a module that other processes find."""
    (tmp_path / "two_centres.py").write_text(EXAMPLES["two_centres.py"])
    monkeypatch.syspath_prepend(str(tmp_path))
    tf.register_architecture("two-centres", import_module("two_centres").TwoCentres)
    yield
    ARCHITECTURES.registered.clear()
    sys.modules.pop("two_centres", None)


def scenario(**settings: Any) -> tf.Scenario:
    return tf.Scenario.load("zhai-spcpf", {"architecture.kind": "two-centres", **settings})


def origins(run: tf.Result, tracker: str = "imm-ukf") -> dict[int, str]:
    """Whose track the base published, by step."""
    rows = run.tracks.to_pylist()
    return {row["step"]: row["origin"] for row in rows if row["source"] == "base" and row["tracker"] == tracker}


def test_both_drivers_agree_with_radio_clocks_batteries_and_a_killed_centre(tmp_path: Path) -> None:
    virtual = tf.run(scenario(**HARD), out=tmp_path / "virtual")
    for speed in SPEEDS:
        real = tf.run(scenario(**HARD), driver="processes", speed=speed, out=tmp_path / f"processes-{speed}")
        if kept_up(real.metrics.plain()):
            break
    assert list(differences(virtual.path, real.path, 0.0)) == []
    frames = virtual.metrics.frames
    assert frames.lost.radio > 20
    assert frames.by_kind["track"].sent > 40
    assert 0.0 < virtual.metrics.clock_error_ms.rms < 20.0


def test_the_base_goes_on_with_the_other_centre(tmp_path: Path) -> None:
    """The target goes from west to east; the western centre is killed when it has nearly left its half."""
    fault = {"kind": "kill", "nodes": ["west"], "at_s": 40}
    run = tf.run(scenario(faults=[fault]), out=tmp_path / "run")
    found = origins(run)
    assert {found[step] for step in range(1, 25)} == {"west"}
    assert {found[step] for step in range(45, 61)} == {"east"}
    figures = run.metrics.trackers["imm-ukf"]
    assert figures.sources == {"base": 60, "east": 60, "west": 39}
    assert figures.verdict == "tracked"
    assert figures.rmse.position < 3.0
    assert figures.views.keys() == {"base", "in-network"}


@pytest.mark.parametrize("cut", [["base"], ["west", "east"]])
def test_with_its_links_cut_the_base_has_no_track(cut: list[str], tmp_path: Path) -> None:
    fault = {"kind": "partition", "nodes": cut, "at_s": 0.5, "until_s": 99}
    settings: dict[str, Any] = {"target.steps": 10, "fusion.trackers": ["ekf"]}
    run = tf.run(scenario(**settings, faults=[fault]), out=tmp_path / "run")
    assert run.metrics.trackers["ekf"].verdict == "lost"
    assert origins(run, "ekf") == {}
    if cut == ["base"]:  # the centres still have theirs
        assert run.metrics.trackers["ekf"].views["in-network"].steps == 10


def test_with_the_frames_of_tracks_deleted_the_base_has_no_track(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    offer = Core.offer

    def without_tracks(core: Core, arrival: Arrival) -> None:
        if arrival.frame.kind != "track":
            offer(core, arrival)

    monkeypatch.setattr(Core, "offer", without_tracks)
    with pytest.raises(tf.RunFailed, match="40 frames were lost by the machine itself"):  # the ledger misses them
        tf.run(scenario(**{"target.steps": 10}), out=tmp_path / "run")
    run = tf.open(tmp_path / "run")
    assert origins(run) == {}
    assert run.metrics.trackers["imm-ukf"].views["in-network"].steps == 10


def test_the_bound_is_finite_and_below_the_errors(tmp_path: Path) -> None:
    """Over six runs: the mean square error of an efficient tracker is 1.0 to 1.5 times the bound's."""
    squares, bounds = [], []
    for seed in range(1, 7):
        run = tf.run(scenario(**{"fusion.trackers": ["imm-ukf"]}), seed=seed, out=tmp_path / str(seed))
        view = run.metrics.trackers["imm-ukf"].views["base"]
        assert view.bound_m is not None
        squares.append(view.rmse.position**2)
        bounds.append(view.bound_m**2)
    assert np.isfinite(bounds).all()
    assert 0.0 < np.mean(bounds) < np.mean(squares) < 3.0 * np.mean(bounds)


def test_a_replay_is_equal_to_the_run(tmp_path: Path) -> None:
    run = tf.run(scenario(**HARD), out=tmp_path / "run")
    again = tf.replay(run, out=tmp_path / "again")
    a, b = (json.loads((one.path / "metrics.json").read_text()) for one in (run, again))
    assert a["trackers"] == b["trackers"]
    assert a["bound"] == b["bound"]
    assert run.tracks.drop_columns(["told_ns"]).equals(again.tracks.drop_columns(["told_ns"]))
    assert origins(tf.replay(run, ["spcpf"], out=tmp_path / "other"), "spcpf") == origins(run)


@pytest.mark.parametrize("until_s", [9.3, 14.01, 20.0])
def test_a_centre_that_returned_and_set_its_clock_first_is_replayed_as_well(until_s: float, tmp_path: Path) -> None:
    """It publishes where it resumes when its first round of asking is over, not as it starts."""
    fault = {"kind": "restart", "nodes": ["west"], "at_s": 8.1, "until_s": until_s}
    settings = HARD | {"faults": [fault], "fusion.smooth_lag": 3, "link.tx_dbm": 20.0}
    run = tf.run(scenario(**settings), out=tmp_path / "run")
    again = tf.replay(run, out=tmp_path / "again")
    assert list(differences(run.path, again.path, 1e-9)) == []
    assert {row["incarnation"] for row in run.tracks.to_pylist() if row["source"] == "west"} == {0, 1}


def test_who_hands_tracks_on_has_no_smoothed_ones_to_lose(tmp_path: Path) -> None:
    settings = {"target.steps": 10, "fusion.trackers": ["ekf"], "fusion.smooth_lag": 3}
    run = tf.run(scenario(**settings), out=tmp_path / "run")
    smoothed = run.metrics.trackers["ekf+lag3"]
    assert (smoothed.verdict, smoothed.steps_expected, smoothed.views["base"].verdict) == (None, 0, None)
    assert (smoothed.views["in-network"].verdict, smoothed.views["in-network"].steps_expected) == ("tracked", 7)
    assert run.metrics.trackers["ekf"].verdict == "tracked"


def test_report_and_timeline_show_all_who_track(tmp_path: Path) -> None:
    run = tf.run(scenario(**HARD), out=tmp_path / "run")
    page = run.report().read_text()
    assert "sensor nodes, west, east used" in page
    assert re.search(r"kill\W.*west\W.*planned", re.sub(r"<[^>]+>|\s+", " ", page))
    timeline = entities(run.path / "run.rrd")
    for source in ("base", "west", "east"):
        assert f"/field/ekf/{source}/track" in timeline
    assert planned(scenario(**HARD)).info.headline == ("base",)
