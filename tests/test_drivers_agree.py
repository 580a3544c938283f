"""The same story under both drivers, told by roles that talk back."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path as FilePath
from threading import Event, Thread
from typing import Any

import psutil
import pytest

from launcher.plan.prepare import load, planned
from launcher.records import BATTERY, SENSES, TRACKS, FieldInfo, Place, Plan, Truth, View
from launcher.run import Outcome, run_processes, run_virtual
from launcher.show import Quiet
from launcher.study.compare import differences
from tests.mortals import hard_times
from tests.running import SPEEDS, kept_up
from tests.toys import party
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.errors import RunFailed
from trackfield.role import NS
from trackfield.world.path import Path

LINKS: dict[str, dict[str, Any]] = {
    "ideal": {"model": "ideal"},
    "fixed": {"model": "fixed", "loss": 0.1, "delay_ms": 5},
    "gilbert_elliott": {
        "model": "gilbert_elliott",
        "good_s": 5,
        "bad_s": 1,
        "loss_good": 0,
        "loss_bad": 1,
        "delay_ms": 20,
        "jitter_ms": 10,
    },
    "lognormal_prr": {"model": "lognormal_prr", "radio": "802154-0dbm", "noise_dbm": -98.0, "busy": 0.3, "ack": 2},
}


def plan_of(link: str, *, talkers: int = 8, steps: int = 20, speed: float = 1.0) -> Plan:
    return toy_plan(*party(talkers, steps=steps, link=LINKS[link], speed=speed))


def toy_plan(run: RunSpec, processes: Sequence[ProcessSpec]) -> Plan:
    """What a run of toys needs besides them."""
    steps = run.end_ns // NS - 1
    path = Path.of([(0.0, 0.0, 0.0, 1.0, 0.0), (float(steps), float(steps), 0.0, 1.0, 0.0)])
    first = [p for p in processes if not p.incarnation]
    places = tuple(Place(p.id, p.role, p.x, p.y, frozenset({SENSES, TRACKS, BATTERY})) for p in first)
    truth = tuple((float(t), float(t), 0.0) for t in range(steps))
    trackers = tuple(place.id for place in places)
    return Plan(
        run,
        tuple(processes),
        {"t": path},
        FieldInfo(run.run, "toys", places, (Truth("t", truth),), trackers, run.end_ns / NS),
        views=(View("base", trackers),),
    )


SHARED = ("trackers", "bytes", "channel", "latency_ms", "energy_j", "lifetime_s", "clock_error_ms")
"""Parts of the metrics that are no matter of the machine."""


def both(plan: Plan, folder: FilePath) -> tuple[Outcome, list[str]]:
    """The plan under both drivers: how the processes fared, and what tells the two runs apart."""
    for speed in (plan.run.speed, *(speed for speed in SPEEDS if speed < plan.run.speed)):
        folders = [folder / f"processes-{speed}", folder / f"virtual-{speed}"]
        for each in folders:
            (each / "logs").mkdir(parents=True)
        real = run_processes(replace(plan, run=replace(plan.run, speed=speed)), folders[0], Quiet())
        if kept_up(real.metrics):
            break
    virtual = run_virtual(plan, folders[1])
    assert real.exit_code == 0, real.complaints
    assert {key: real.metrics[key] for key in SHARED} == {key: virtual.metrics[key] for key in SHARED}
    assert real.metrics["frames"] == virtual.metrics["frames"]
    return real, differences(*folders, 0.0)


@pytest.mark.parametrize("link", LINKS)
def test_roles_that_talk_back_tell_the_same_story(link: str, tmp_path: FilePath) -> None:
    """Requests, replies and feedback, where a wrong order decides everything after: equal to the last bit."""
    real, found = both(plan_of(link, speed=5), tmp_path)
    assert real.exit_code == 0
    assert real.metrics["timing"]["host_late"] == 0
    assert real.metrics["frames"]["sent"] > 200
    assert found == []


def test_a_receiver_that_stalls_comes_to_the_same_tracks(tmp_path: FilePath) -> None:
    """Now and then the hub is stopped for 50 ms: what it missed it puts in its place afterwards."""
    done = Event()
    stalls = 0

    def stall() -> None:
        nonlocal stalls
        while not done.wait(0.25):
            with suppress(psutil.Error):  # it is over
                for process in psutil.Process().children(recursive=True):
                    if process.cmdline()[:1] == ["trackfield hub"]:
                        process.suspend()
                        time.sleep(0.05)
                        process.resume()
                        stalls += 1

    thread = Thread(target=stall)
    thread.start()
    try:
        real, found = both(plan_of("fixed", steps=12), tmp_path)
    finally:
        done.set()
        thread.join()
    assert stalls > 10
    assert real.exit_code == 0
    assert real.metrics["timing"]["slip_ms"]["p99"] > 5
    assert found == []


@pytest.mark.parametrize("link", ["ideal", "fixed", "gilbert_elliott"])
def test_the_paper_scenario_is_the_same_under_both_drivers(link: str, tmp_path: FilePath) -> None:
    plan = planned(load("spcpf", link=link, seed=1), speed=5)
    real, found = both(plan, tmp_path)
    assert real.metrics["timing"]["host_late"] == 0
    assert real.metrics["frames"]["host_lost"] == 0
    assert found == []


def test_a_process_that_dies_at_start_is_named_with_its_log(tmp_path: FilePath) -> None:
    (tmp_path / "logs").mkdir()
    plan = plan_of("ideal", talkers=3)
    broken = replace(plan.processes[1], factory="tests.toys:no_such_role")
    with pytest.raises(RunFailed, match=r"t00 died at start.*exit code 1") as failure:
        run_processes(replace(plan, processes=(plan.processes[0], broken)), tmp_path, Quiet())
    assert "no_such_role" in failure.value.log
    assert failure.value.process == "t00"


# --- hard times ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("link", ["fixed", "lognormal_prr"])
def test_hard_times_are_the_same_under_both_drivers(link: str, tmp_path: FilePath) -> None:
    """Clocks that are off and jump, sleep, freezes, kills and restarts, the hub's too, cuts, and empty batteries."""
    real, found = both(toy_plan(*hard_times(link=LINKS[link], speed=3)), tmp_path)
    assert found == []
    lost = real.metrics["frames"]["lost"]
    assert all(lost[cause] > 0 for cause in ("radio", "partition", "asleep", "frozen", "dead")), lost
    assert real.metrics["timing"]["host_late"] == 0
    assert 0 < real.metrics["lifetime_s"]["first_death"] < 20
    assert real.metrics["clock_error_ms"]["max"] > 400


FAULTS = """[
{kind='kill', nodes=['n060'], at_s=10}, {kind='restart', nodes=['fusion'], at_s=20, until_s=23},
{kind='restart', nodes=['n049'], at_s=6, until_s=9}, {kind='freeze', share=0.1, at_s=5, until_s=8.3},
{kind='partition', share=0.2, at_s=15, until_s=18}, {kind='clock_jump', nodes=['n072'], jump_ms=500, at_s=11},
{kind='stuck', nodes=['n061'], at_s=3, until_s=12}, {kind='bias', nodes=['n071'], bias_deg=20, at_s=2},
{kind='babble', nodes=['n038'], at_s=2, until_s=13}, {kind='deaf', nodes=['n073'], at_s=11},
{kind='freeze', nodes=['fusion'], at_s=25, until_s=26.2}]""".replace("\n", " ")


def test_the_paper_scenario_is_the_same_under_every_fault(tmp_path: FilePath) -> None:
    """With all that a scenario can have: a centre that moves, sets thresholds and clocks over the radio, takes in what
    comes late, and is killed; acknowledgements, sleep, and batteries that empty."""
    settings = [
        "target.steps=30", "sensor.threshold=adaptive", "fusion.max_age_s=1",
        "fusion.path=[[0, 350, 350], [25, 500, 400]]", "link.ack=3",
        "clock.offset_ms=30", "clock.drift_ppm=50", "clock.resync_s=10", "fusion.smooth_lag=2",
        "energy.battery_j=0.3", "energy.sample_mj=0.05", f"faults={FAULTS}",
    ]  # fmt: skip
    real, found = both(planned(load("spcpf", link="lognormal_prr", seed=1, settings=settings), speed=3), tmp_path)
    assert found == []
    lost = real.metrics["frames"]["lost"]
    assert all(lost[cause] > 0 for cause in ("partition", "frozen", "dead")), lost
    assert real.metrics["timing"]["host_late"] == 0
    assert 0 < real.metrics["lifetime_s"]["first_death"] < 31
    assert {"doa", "sync-request", "sync-reply", "threshold"} <= real.metrics["frames"]["by_kind"].keys()


KINDS: dict[str, list[str]] = {
    "range": [],
    "rss": ["sensor.slow=0.4", "sensor.slow_s=5", "sensor.fixed=0.2"],
    "energy": ["sensor.window_s=1", "sensor.sound_m_s=343"],
}
SENSOR_FAULTS = """[
{kind='babble', nodes=['n000'], at_s=2, until_s=7}, {kind='stuck', nodes=['n001'], at_s=4},
{kind='bias', nodes=['n002'], by=[3.5], at_s=3}, {kind='deaf', nodes=['n003'], at_s=5, until_s=8},
{kind='restart', nodes=['n004'], at_s=3, until_s=6}, {kind='kill', nodes=['n005'], at_s=8},
{kind='clock_jump', nodes=['n006'], jump_ms=300, at_s=6}]""".replace("\n", " ")


@pytest.mark.parametrize("kind", KINDS)
def test_a_field_of_each_kind_is_the_same_under_every_fault(kind: str, tmp_path: FilePath) -> None:
    """Nine sensors, whose readings remember: shadowing that lasts, sound that is late and adds up over a window."""
    settings = [
        "field.extent_m=100", "target.steps=10", f"sensor.kind={kind}", *KINDS[kind], "fusion.trackers=['ekf', 'ukf']",
        "fusion.prior=none", "fusion.max_age_s=1", "clock.offset_ms=30", f"faults={SENSOR_FAULTS}",
    ]  # fmt: skip
    real, found = both(planned(load("spcpf", link="fixed", seed=1, settings=settings), speed=2), tmp_path)
    assert found == []
    assert real.metrics["frames"]["by_kind"][kind]["sent"] > 50
    assert min(real.metrics["trackers"][name]["steps_tracked"] for name in ("ekf", "ukf")) > 5
    assert real.metrics["timing"]["host_late"] == 0
