"""Trackers that users bring: registered in Python, or the entry point of an installed package; and their options."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

import trackfield as tf
from launcher.plan.extensions import check_importable
from launcher.plan.prepare import planned
from launcher.records import Plan
from tests.command_line import Call, trackfield
from tests.running import Run
from tests.simulated import simulated
from trackfield.filters.trackers import TRACKERS, make_tracker, register_tracker
from trackfield.plugins import Plugins, give
from trackfield.scenario import Scenario

__all__ = ["trackfield"]

SHORT = {"target.steps": 12, "field.nodes": 30}


@dataclass(frozen=True)
class Still:
    """Says that the target stands at its prior, ``east`` metres further east."""

    east: float = 0.0
    times: int = 1
    mood: Literal["calm", "wild"] = "calm"
    loud: bool = False
    label: str | None = None

    def __post_init__(self) -> None:
        if self.times < 1:
            raise ValueError(f"times is {self.times}; at least 1")

    def init(self, prior: tf.Gaussian, model: tf.Model) -> tf.Gaussian:
        return prior

    def step(self, state: tf.Gaussian, reports: tf.Reports, dt: float, rng: Any) -> tuple[Any, Any]:
        mean = state.mean + np.array([self.east, 0.0, 0.0, 0.0])
        return state, tf.Estimate(mean, state.covariance)


@pytest.fixture(autouse=True)
def none_left() -> Iterator[None]:
    """No test leaves a name behind."""
    yield
    TRACKERS.registered.clear()


def plan_with(*trackers: str, **settings: Any) -> Plan:
    keys = {"fusion.trackers": list(trackers), **{f"fusion.{key}": value for key, value in settings.items()}}
    return planned(Scenario.load("spcpf", SHORT | keys))


def refused(*trackers: str, **settings: Any) -> str:
    with pytest.raises(tf.ScenarioError) as caught:
        plan_with(*trackers, **settings)
    return str(caught.value)


# --- registered in the process ---


def test_a_registered_tracker_runs_beside_others() -> None:
    register_tracker("still", Still)
    options = {"still": {"east": 5}, "off": {"tracker": "still", "east": 30.0}}
    _, rows = simulated(plan_with("still", "off", "imm-ukf", options=options))
    points = {(row.point.tracker, row.point.step): row.point for row in rows}
    assert {name for name, _ in points} == {"still", "off", "imm-ukf"}
    for step in range(1, 13):
        assert points["off", step].mean[0] - points["still", step].mean[0] == pytest.approx(25.0)
    assert "still" in TRACKERS


def test_the_last_of_a_name_counts() -> None:
    register_tracker("still", Still)
    register_tracker("still", lambda: Still(east=7.0))
    assert make_tracker("still").tracker == Still(east=7.0)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("name", "maker", "says"),
    [
        ("spcpf", Still, "register_tracker: 'spcpf' is a tracker of Trackfield's own; expected another name"),
        ("my tracker", Still, "'my tracker' is not a valid name for a tracker; expected 1 to 32 letters"),
        ("mine", dict, "tracker 'mine' has no init, step; expected a class with init, step"),
        ("mine", Still(), "tracker 'mine' is not a class"),
    ],
)
def test_what_cannot_be_registered(name: str, maker: Any, says: str) -> None:
    with pytest.raises(tf.ScenarioError) as caught:
        tf.register_tracker(name, maker)
    assert says in str(caught.value)


def test_processes_need_a_class_that_can_be_imported() -> None:
    class Local(Still):
        pass

    register_tracker("still", Still)
    register_tracker("local", Local)
    check_importable(plan_with("still"))
    with pytest.raises(tf.ScenarioError, match=r"'local': is defined in a function .*expected a class at the top of a"):
        check_importable(plan_with("still", "local"))
    Local.__module__, Local.__qualname__ = "__main__", "Local"
    with pytest.raises(tf.ScenarioError, match="'local': is defined in the main program"):
        check_importable(plan_with("still", "local"))


def test_another_process_finds_it_by_its_place() -> None:
    assert "far" not in TRACKERS
    give({"tracker:far": f"{__name__}:Still"}, installed=False)
    try:
        assert make_tracker("far", {"east": 3.0}).tracker == Still(east=3.0)  # type: ignore[attr-defined]
        assert list(TRACKERS) == [*TRACKERS.own, "far"]
    finally:
        give({}, installed=True)


# --- options ---


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"est": 1.0}, ".est: unknown option; did you mean east?; expected one of east, times, mood, loud, label"),
        ({"east": "far"}, ".east: is 'far'; expected a number"),
        ({"east": True}, ".east: is True; expected a number"),
        ({"times": 1.5}, ".times: is 1.5; expected a whole number"),
        ({"mood": "mad"}, ".mood: is 'mad'; expected one of calm, wild"),
        ({"loud": 1}, ".loud: is 1; expected true or false"),
        ({"label": 4}, ".label: is 4; expected a text"),
        ({"times": 0}, ": times is 0; at least 1"),
    ],
)
def test_options_are_checked_when_a_run_is_planned(options: dict[str, Any], says: str) -> None:
    register_tracker("still", Still)
    assert refused("still", options={"still": options}) == f"fusion.options.still{says}"


def test_options_that_fit() -> None:
    options = {"east": 2, "times": 3, "mood": "wild", "loud": True, "label": "x"}
    register_tracker("still", Still)
    assert make_tracker("still", options).tracker == Still(2, 3, "wild", True, "x")  # type: ignore[attr-defined]


def test_options_of_trackers_that_there_are_none() -> None:
    assert refused("spcpf", options={"spcf": {"nominals": 3}}).startswith("fusion.options.spcf: there is no tracker")
    assert "unknown tracker 'spc'; expected 'spcpf'" in refused("n5", options={"n5": {"tracker": "spc"}})
    assert refused("spcpf", options={"bootstrap": {"m": 3}}).startswith("fusion.options.bootstrap.m: unknown option")
    plan_with("spcpf", options={"bootstrap": {"n": 30}})  # of one that does not run today


@pytest.mark.parametrize(
    ("option", "value", "expected"),
    [
        ("n", 10**9, "a whole number from 1 to 100000"),
        ("n", 0, "a whole number from 1 to 100000"),
        ("n", True, "a whole number from 1 to 100000"),
        ("ess_share", 1.5, "a number from 0 to 1"),
        ("ess_share", 1e-320, ""),
    ],
)
def test_an_option_out_of_its_range(option: str, value: Any, expected: str) -> None:
    if not expected:
        plan_with("bootstrap", options={"bootstrap": {option: value}})
        return
    said = refused("bootstrap", options={"bootstrap": {option: value}})
    assert said == f"fusion.options.bootstrap.{option}: is {value!r}; expected {expected}"


def test_bad_options_end_the_command(trackfield: Call) -> None:
    said = trackfield("run", "spcpf", "--virtual", "--set", "fusion.options.spcpf.nominal=3", "--out", "a")
    assert (said.code, said.out) == (2, "")
    assert said.err == (
        "trackfield: fusion.options.spcpf.nominal: unknown option; did you mean nominals?; "
        "expected one of particles, nominals, weights, single, robust\n"
    )
    assert not Path("a").exists()


# --- trackers that are wrong ---


def wrong(step: Any) -> Any:
    """A tracker whose step returns what ``step`` makes of a right estimate."""

    class Wrong(Still):
        def step(self, state: Any, reports: tf.Reports, dt: float, rng: Any) -> tuple[Any, Any]:
            return state, step(super().step(state, reports, dt, rng)[1])

    return Wrong


@pytest.mark.parametrize(
    ("step", "says"),
    [
        (lambda e: tf.Estimate(e.mean[:2], e.covariance), "mean is of shape (2,); expected an array of shape (4,)"),
        (lambda e: tf.Estimate(e.mean, e.covariance[0]), "covariance is of shape (4,); expected an array of shape (4"),
        (lambda e: tf.Estimate([1.0] * 4, e.covariance), "mean is a list; expected an array of shape (4,)"),
        (lambda e: tf.Estimate(e.mean * np.nan, e.covariance), "mean is not finite: [nan nan nan nan]"),
        (lambda e: tf.Estimate(e.mean, e.covariance, np.ones((5, 4))), "particles is of shape (5, 4); expected an"),
        (lambda e: (e.mean, e.covariance), "step returned tuple; expected a state and an Estimate"),
    ],
)
def test_a_wrong_estimate_is_told_with_the_trackers_name(step: Any, says: str) -> None:
    register_tracker("wrong", wrong(step))
    with pytest.raises(tf.RunFailed) as caught:
        simulated(plan_with("wrong"))
    assert str(caught.value).startswith(f"tracker 'wrong', step 1: {says}")


def test_a_trackers_own_error_has_a_note_that_says_when() -> None:
    register_tracker("wrong", wrong(lambda estimate: estimate.nothing))
    with pytest.raises(tf.RunFailed, match=r"'nothing' \(test_own_trackers.py, line \d+; in tracker 'wrong', step 1, "):
        simulated(plan_with("wrong"))


def test_a_tracker_that_tells_its_motion_is_smoothed() -> None:
    class Foreseeing(Still):
        def motion(self, before: Any, after: Any, dt: float) -> tuple[Any, Any]:
            return np.eye(4), np.eye(4) * (1.0 if dt == 1.0 else np.nan)

    register_tracker("still", Still)
    register_tracker("foreseeing", Foreseeing)
    plan = plan_with("still", "foreseeing", smooth_lag=2)
    _, rows = simulated(plan)
    assert {row.point.tracker for row in rows} == {"still", "foreseeing", "foreseeing+lag2"}
    Foreseeing.motion = lambda self, before, after, dt: (np.eye(4), np.eye(2))  # type: ignore[assignment,method-assign]
    with pytest.raises(tf.RunFailed, match=r"tracker 'foreseeing': Q of its motion is of shape \(2, 2\)"):
        simulated(plan)


# --- installed packages ---


def installed(folder: Path, **entries: str) -> dict[str, str]:
    """The environment in which a package with these trackers is installed."""
    (folder / "still-1.0.dist-info").mkdir(parents=True)
    (folder / "still-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: still\nVersion: 1.0\n")
    lines = "".join(f"{name} = {value}\n" for name, value in entries.items())
    (folder / "still-1.0.dist-info" / "entry_points.txt").write_text(f"[trackfield.trackers]\n{lines}")
    (folder / "astray.py").write_text(
        "from tests.test_own_trackers import Still\n\n\nclass Astray(Still):\n    def step(self, *_):\n        1 / 0\n"
    )
    return {"PYTHONPATH": os.pathsep.join(filter(None, (str(folder), os.environ.get("PYTHONPATH"))))}


def command(environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "launcher.cli", *arguments],
        capture_output=True,
        text=True,
        env={**os.environ, **environment},
        check=False,
    )


def test_an_entry_point_is_listed_and_loaded_only_when_named(tmp_path: Path) -> None:
    environment = installed(tmp_path, still="tests.test_own_trackers:Still", gone="nowhere:Gone")
    names = [line.split()[0] for line in command(environment, "list", "trackers").stdout.splitlines() if line[0] != " "]
    assert names == [*TRACKERS, "still", "gone"]
    said = command(environment, "validate", "spcpf", "--set", "fusion.trackers=['gone']")
    assert said.returncode == 2
    assert said.stderr == (
        "trackfield: tracker 'gone': cannot be loaded from nowhere:Gone "
        "(ModuleNotFoundError: No module named 'nowhere')\n"
    )


def test_processes_run_an_installed_tracker(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that works, and one that raises: the centre dies of it, and the report ends with the traceback."""
    environment = installed(tmp_path / "lib", still="tests.test_own_trackers:Still", astray="astray:Astray")
    monkeypatch.setenv("PYTHONPATH", environment["PYTHONPATH"])
    options = ("spcpf", "--nodes", "9", "--set", "target.steps=3", "--quiet")
    good = Run(tmp_path / "good", *options, "--tracker", "still", "--tracker", "spcpf")
    bad = Run(tmp_path / "bad", *options, "--tracker", "astray")
    assert good.finish()[0] == 0
    assert good.metrics()["trackers"].keys() == {"still", "spcpf"}
    assert good.metrics()["trackers"]["still"]["steps"] == 3
    code, said = bad.finish()
    assert code == 1
    assert "fusion died at" in said
    assert "ZeroDivisionError: division by zero" in said
    assert "in tracker 'astray', step 1, " in said


def test_a_maker_of_an_entry_point_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    from importlib.metadata import EntryPoint

    plugins = Plugins("tracker", "nobody.has.this", {"a": Still}, methods=("init", "step"))
    entries = {"bad": EntryPoint("bad", "collections:OrderedDict", "g"), "a": EntryPoint("a", "nowhere:A", "g")}
    monkeypatch.setitem(plugins.__dict__, "_installed", entries)
    assert list(plugins) == ["a", "bad"]
    assert plugins["a"] is Still  # our own comes first
    with pytest.raises(tf.ScenarioError, match="collections:OrderedDict: tracker 'bad' has no init, step"):
        plugins["bad"]
