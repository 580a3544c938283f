"""Planned faults of containers: what a scenario says of them, and what a run makes of processes that are away."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from launcher import api
from launcher.away import NOTICE_S, Away, as_planned, not_done
from launcher.plan.prepare import load, planned
from launcher.processes.places.told import LOOK_S, Told
from launcher.record.folder import keep, prepare_folder
from launcher.record.ledger import Ledger
from launcher.report.folder import read_run
from launcher.report.outages import downs
from launcher.report.parts.field import dead_sensors
from launcher.report.parts.troubles import troubles
from launcher.run import run_virtual
from tests.command_line import Call, trackfield
from tests.test_faults import failure, fault, faults
from tests.test_ledger import END, IDEAL, frame, processes
from trackfield.drivers.spec import RunSpec
from trackfield.errors import ScenarioError
from trackfield.role import NEIGHBOURHOOD
from trackfield.scenario import Scenario

__all__ = ["trackfield"]
KILL = "faults=[{kind='container-kill',nodes=['n002'],at_s=3}]"
CUT = Away(0, "container-disconnect", "n002", 10.0, 30.0, "field")
ELSEWHERE = ("--external", "--connect", "tcp/127.0.0.1:7447")


# --- the plan -------------------------------------------------------------------------------------------------------


def test_each_process_that_one_befalls_is_away_from_its_beginning_to_its_end() -> None:
    plan = faults(
        fault("container-disconnect", 30, 40, nodes=("n001", "fusion"), network="backbone"),
        fault("container-kill", 20),
        fault("container-pause", 50, 100, nodes=("n002",)),
        fault("container-restart", 1, 2, nodes=("n003",)),
    )
    assert plan.aways == (
        Away(3, "container-restart", "n003", 1.0, 2.0),
        Away(1, "container-kill", "n060", 20.0),
        Away(0, "container-disconnect", "fusion", 30.0, 40.0, "backbone"),
        Away(0, "container-disconnect", "n001", 30.0, 40.0, "backbone"),
        Away(2, "container-pause", "n002", 50.0),
    )


def test_they_leave_emulated_time_alone() -> None:
    """A process is killed and started by the engine, and not by its own driver."""
    plan = faults(fault("container-kill", 20), fault("container-pause", 10, 20, nodes=("n061",)))
    assert plan.of("n060") == plan.of("n061") == faults().of("n060")
    assert plan.partitions == ()


def test_they_are_marked_and_last_as_other_faults_do() -> None:
    plan = faults(fault("container-restart", 20, 30), fault("container-pause", 40, 100))
    assert plan.marks == (
        (20.0, "n060", "container-restart until 30 s"),
        (30.0, "n060", "up again"),
        (40.0, "n060", "container-pause"),
    )
    assert plan.spells == (
        (20.0, 30.0, "n060", "container-restart until 30 s"),
        (40.0, 61.0, "n060", "container-pause"),
    )


@pytest.mark.parametrize(
    ("written", "message"),
    [
        (
            [fault("container-kill", 20), fault("kill", 30)],
            "faults[1].at_s: kill of n060 at 30 s, during faults[0] (container-kill for good); expected a",
        ),
        (
            [fault("kill", 20), fault("container-pause", 30, 40)],
            "faults[1].at_s: container-pause of n060 at 30 s, during faults[0] (kill for good)",
        ),
        (
            [fault("container-disconnect", 20, 30, network="field"), fault("container-restart", 25, 40)],
            "faults[1].at_s: container-restart of n060 at 25 s, during faults[0] (container-disconnect until 30 s)",
        ),
        ([fault("container-restart", 20, 61)], "faults[0].until_s: is 61, and the run ends at 61 s"),
        ([fault("container-restart", 20, 20.5)], "faults[0].until_s: is 20.5; expected a time at least 1 s after at_s"),
        ([fault("container-pause", 20, 10)], "faults[0].until_s: is 10; expected a time at least 0.001 s after at_s"),
        ([fault("container-kill", 20, nodes=("m1",))], "faults[0].nodes: there is no 'm1'"),
    ],
)  # fmt: skip
def test_what_contradicts_another_fault_is_refused(written: list[dict[str, Any]], message: str) -> None:
    assert failure(*written).startswith(message)


def test_one_after_the_other_is_allowed() -> None:
    assert (
        len(faults(fault("container-pause", 10, 20), fault("container-restart", 21, 30), fault("kill", 40)).aways) == 2
    )


def test_a_network_that_no_field_has_is_refused() -> None:
    with pytest.raises(ScenarioError) as caught:
        faults(fault("container-disconnect", 20, 30, network="serial"))
    assert str(caught.value) == 'faults[0].network: is "serial"; expected one of field, backbone'


# --- runs without containers ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", [(), ("--virtual",), ("--listen", "tcp/127.0.0.1:7447")])
def test_a_run_without_containers_is_refused(trackfield: Call, options: tuple[str, ...]) -> None:
    said = trackfield("run", "spcpf", "--nodes", "4", "--set", KILL, *options)
    assert (said.code, said.out) == (2, "")
    assert said.err == (
        "trackfield: faults[0].kind: container-kill befalls a container, and n002 is in none in this run; expected "
        "a run in containers (make field, docs/containers.md), or kind = 'kill'\n"
    )


@pytest.mark.parametrize("kind", ["kill", "restart", "pause", "disconnect"])
def test_a_study_and_the_api_refuse_them_and_name_one_that_they_take(kind: str) -> None:
    until = {} if kind == "kill" else {"until_s": 20}
    scenario = Scenario.load("spcpf", {"faults": [{"kind": f"container-{kind}", "share": 0.1, "at_s": 10, **until}]})
    taken = {"kill": "kill", "restart": "restart", "pause": "freeze", "disconnect": "partition"}[kind]
    for attempt in (lambda: api.run(scenario), lambda: api.study(scenario, [1])):
        with pytest.raises(ScenarioError) as caught:
            attempt()
        assert caught.value.expected.endswith(f"or kind = '{taken}'")
    assert planned(Scenario.load("spcpf", {"faults": [{"kind": taken, "share": 0.1, "at_s": 10, **until}]}))


def test_validate_lists_them_for_a_run_in_containers(trackfield: Call) -> None:
    said = trackfield("validate", "spcpf", "--nodes", "4", "--set", KILL, *ELSEWHERE, "--json", "--quiet")
    assert said.code == 0, said.err
    assert json.loads(said.out)["containers"] == [
        {"fault": 0, "kind": "container-kill", "id": "n002", "at_s": 3.0, "until_s": None, "network": ""}
    ]


# --- who is away ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "since_s", "explained"),
    [
        ("n002", 10.0, True),
        ("n002~1", 20.0, True),
        ("n002", 30.0 + NOTICE_S, True),
        ("n002", 30.1 + NOTICE_S, False),
        ("n002", 9.9, False),
        ("n002", None, False),
        ("n0021", 20.0, False),
        ("recorder", 20.0, False),
    ],
)
def test_only_its_own_process_is_away_as_planned_and_only_then(
    name: str, since_s: float | None, explained: bool
) -> None:
    assert as_planned([CUT], name, since_s, 1.0) is explained


def test_what_takes_wall_time_takes_more_emulated_time_in_a_fast_run() -> None:
    assert not as_planned([CUT], "n002", 31 + NOTICE_S, 1.0)
    assert as_planned([CUT], "n002", 31 + NOTICE_S, 5.0)


@given(st.floats(0, 1e6))
def test_one_that_is_killed_stays_away(since_s: float) -> None:
    assert as_planned([Away(0, "container-kill", "n002", 10.0)], "n002", since_s, 1.0) == (since_s >= 10.0)


def test_what_the_log_does_not_tell_of_was_not_done() -> None:
    kill, late = Away(1, "container-kill", "n003", 8.25), Away(2, "container-kill", "n004", 90.0)
    log = "\n".join(
        (
            "container-kill of n003 at 8.25 s: docker kill c, from 8.25 s to 8.4 s",
            "container-disconnect of n002 at 10 s: failed: no such network",
            "container-disconnect of n002 at 10 s ends: failed: it did not begin",
        )
    )
    assert not_done([CUT, kill, late], log, 60.0) == [CUT]
    assert not_done([CUT, kill, late], "", 60.0) == [CUT, kill]
    assert not_done([CUT, kill, late], "", 5.0) == []


def book(*cut_off: str) -> Ledger:
    """Two broadcasts of ``a``, of more than it made two by its own count; ``b`` got one of them."""
    made = Ledger(RunSpec("r", 1, END, IDEAL, media={"backbone": IDEAL}), processes(), cut_off=cut_off)
    for t_ms in (100, 200):
        made.sent(frame(t_ms, to=NEIGHBOURHOOD), 0)
    made.close()
    made.final("a", {"puts": 5, "sent": 4, "sent_hash": 7, "told": 3})
    made.final("b", {"heard": 1, "heard_hash": 1})
    return made


@pytest.mark.parametrize(
    ("cut_off", "by_containers", "dropped", "untold"),
    [((), 0, 3, 3), (("a",), 2, 0, 0), (("b",), 1, 3, 3), (("a", "b"), 3, 0, 0), (("c",), 0, 3, 3)],
)
def test_what_is_lost_at_those_that_are_cut_off_is_not_lost_by_the_machine(
    cut_off: tuple[str, ...], by_containers: int, dropped: int, untold: int
) -> None:
    made = book(*cut_off)
    assert made.sums()["host_lost"] == 3
    assert made.lost_by_containers() == by_containers
    assert made.dropped() == dropped
    assert made.complaints() == (
        [f"{untold} pieces of telemetry never reached the recorder: states or tracks may be missing"] if untold else []
    )


def test_a_report_tells_of_them_as_of_other_faults(tmp_path: Path) -> None:
    """Of a run in virtual time, in which nobody brings them about."""
    restart = "{kind='container-restart',nodes=['fusion','n001'],at_s=2,until_s=4}"
    pause = "{kind='container-pause',nodes=['n002'],at_s=3,until_s=99}"
    scenario = load("spcpf", settings=[f"faults=[{restart},{pause}]", "target.steps=6"], nodes=4)
    folder = prepare_folder(tmp_path / "run", "s", 1)
    keep(scenario, folder)
    run_virtual(planned(scenario), folder, write=lambda _: None)
    run = read_run(folder)
    assert [(one.id, one.from_s, one.until_s, one.text) for one in downs(run)] == [
        ("fusion", 2.0, 4.0, "fusion was away at 2 s (container-restart)")
    ]
    assert dead_sensors(run) == {"fusion", "n001"}
    rows = [row[:3] for row in troubles(run).rows]
    assert ["2 s", "container-restart until 4 s", "fusion, n001"] in rows
    assert ["3 s", "container-pause", "n002"] in rows


# --- what a run tells the host ----------------------------------------------------------------------------------------


def test_where_everybody_is_is_told_when_it_begins_changes_and_is_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 0.0
    monkeypatch.setattr("launcher.processes.places.told.time.monotonic", lambda: now)
    told = Told(planned(load("spcpf", settings=[KILL], nodes=4), 2.0), tmp_path)
    file = tmp_path / "places.json"
    told.look(None, {"n002": "a"})
    assert not file.exists()
    told.look(7, {"n002": "a"})
    about = json.loads(file.read_text())
    assert about.pop("run").startswith("zhai-spcpf-1-")
    kill = {"fault": 0, "kind": "container-kill", "id": "n002", "at_s": 3.0, "until_s": None, "network": ""}
    assert about == {
        "speed": 2.0, "first_step_s": 0.0, "faults": [kill], "begun_ns": 7, "places": {"n002": "a"}, "over": False
    }  # fmt: skip
    told.look(7, {"n002": "a", "n002~1": "b"})
    assert json.loads(file.read_text())["places"] == {"n002": "a"}  # not at every look
    now += LOOK_S
    told.look(7, {"n002": "a", "n002~1": "b"})
    assert json.loads(file.read_text())["places"] == {"n002": "b"}
    told.look(7, {"n002": "a", "n002~1": "b"}, over=True)
    now += LOOK_S
    told.look(7, {"n002": "a", "n002~1": "c"})
    assert json.loads(file.read_text())["over"] is True


def test_a_run_without_such_faults_tells_nothing(tmp_path: Path) -> None:
    Told(planned(load("spcpf", nodes=4)), tmp_path).look(7, {"n002": "a"}, over=True)
    assert list(tmp_path.iterdir()) == []
