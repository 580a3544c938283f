"""A field in slices: three of them on this machine, each with its own router, and what happens when one goes."""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from launcher.blocks import blocks, span
from launcher.plan.prepare import load, planned
from launcher.processes.places.desk import standing
from launcher.slices.command import RETRY_S
from launcher.study.compare import differences
from tests.command_line import Call, trackfield
from tests.running import SPEEDS, Run, kept_up, leftovers, until
from tests.sliced import Sliced, SliceProcess, descendants, free_endpoint, on_time
from tests.test_drivers_agree import SHARED

__all__ = ["trackfield"]

FAULTS = (
    "faults=[{kind='kill', nodes=['n004'], at_s=4}, {kind='restart', nodes=['n001'], at_s=2, until_s=5}, "
    "{kind='freeze', nodes=['n002'], at_s=3, until_s=4}]"
)
FIELD = ("spcpf", "--nodes", "9", "--set", "sensor.threshold=0.5")
SHORT = (*FIELD, "--set", "target.steps=10", "--set", FAULTS)
LONG = (*FIELD, "--set", "target.steps=30")


def blocks_of(of: int) -> dict[int, tuple[str, ...]]:
    """The ids of each slice of ``FIELD``."""
    plan = planned(load("spcpf", nodes=9, settings=["sensor.threshold=0.5"]), 1.0)
    return dict(enumerate(blocks(standing(plan.in_slices), of), 1))


def test_three_slices_are_the_same_run_as_in_virtual_time(tmp_path: Path) -> None:
    """With a kill, a restart and a freeze, all planned: each slice is done, and nothing else tells the runs apart."""
    sliced = on_time(tmp_path / "sliced", 3, *SHORT)
    assert sliced.finish()[0] == 0, sliced.run.said()
    assert [one.finish()[0] for one in sliced.slices.values()] == [0, 0, 0], sliced.slices[1].said()
    virtual = Run(tmp_path / "virtual", *SHORT, "--virtual")
    assert virtual.finish()[0] == 0
    assert differences(sliced.run.folder, virtual.folder, 0.0) == []
    ours, theirs = sliced.run.metrics(), virtual.metrics()
    assert ours["frames"] == theirs["frames"]
    assert {key: ours[key] for key in SHARED} == {key: theirs[key] for key in SHARED}
    assert ours["frames"]["sent"] > 30
    logs = [sorted(log.stem for log in (one.folder / "logs").iterdir()) for one in sliced.slices.values()]
    assert [{log.partition("~")[0] for log in some} - {"router"} for some in logs] == [
        set(ids) for ids in blocks_of(3).values()
    ]


@pytest.mark.alone
def test_slices_of_hundreds_of_processes_are_one_run(tmp_path: Path) -> None:
    """More than Zenoh's own handlers queue (256): a launcher that asked who is there once waited for itself."""
    sliced = Sliced(tmp_path, 3, "zhai-spcpf", "--nodes", "300", "--set", "target.steps=8")
    assert sliced.finish()[0] == 0, sliced.run.said()
    assert [one.finish()[0] for one in sliced.slices.values()] == [0, 0, 0]
    assert sliced.run.metrics()["processes"]["started"] > 300


def test_a_slice_that_is_killed_and_started_again_goes_on_as_the_next_lives(tmp_path: Path) -> None:
    """The launcher says which slice was gone; batteries go on where those of the lives before were."""
    sliced = Sliced(tmp_path, 3, *LONG, "--set", "energy.battery_j=50", "--set", "energy.sample_mj=5")
    sliced.run.started()
    time.sleep(4)
    sliced.slices[2].kill()
    assert sliced.slices[2].finish()[0] == -signal.SIGKILL
    again = sliced.start("2/3", name="again")
    code, said = sliced.run.finish()
    assert code == 1, said
    assert (again.finish()[0], sliced.slices[1].finish()[0], sliced.slices[3].finish()[0]) == (0, 0, 0), again.said()
    why = f"slice 2/3 on {socket.gethostname()} died, or cannot be reached"
    deaths = sliced.run.metrics()["processes"]["died"]
    assert {death["id"] for death in deaths} == {"slice-2", *blocks_of(3)[2]}
    [slice] = [death for death in deaths if death["id"] == "slice-2"]
    assert slice["why"] == why
    assert 1 < slice["t"] < 30
    assert f"slice-2 died at {slice['t']:.1f} s: {why} (started again)" in said
    rows = pq.read_table(sliced.run.folder / "messages.parquet").to_pylist()
    lives = {id: {row["incarnation"] for row in rows if row["src"] == id} for id in (f"n{i:03}" for i in range(9))}
    assert [id for id, some in lives.items() if some == {0, 1}] == sorted(blocks_of(3)[2]), lives
    assert all(some == {0} for id, some in lives.items() if id not in blocks_of(3)[2])


def test_a_slice_that_is_told_to_end_says_that_it_leaves(tmp_path: Path) -> None:
    sliced = Sliced(tmp_path, 2, *FIELD, "--set", "target.steps=8")
    sliced.run.started()
    sliced.slices[1].kill(signal.SIGTERM)
    code, said = sliced.slices[1].finish()
    assert code == 128 + signal.SIGTERM
    assert said.splitlines()[-1] == "slice 1/2 leaves before its processes are done"
    code, said = sliced.run.finish()
    assert code == 1
    assert "failed: slice-1 died at " in said
    assert f" s: slice 1/2 on {socket.gethostname()} left\n" in said
    assert sliced.slices[2].finish()[0] == 0


def test_a_process_that_dies_unplanned_is_told_by_its_slice(tmp_path: Path) -> None:
    sliced = Sliced(tmp_path, 1, *FIELD, "--set", "target.steps=8")
    sliced.run.started()
    family = until(lambda: {child.cmdline()[0]: child for child in descendants(sliced.slices[1].process.pid)})
    one = family["trackfield node n003"]
    assert not [file.path for file in one.memory_maps() if "numpy" in file.path]  # as light as nodes of a launcher
    one.kill()
    code, said = sliced.slices[1].finish()
    assert code == 1
    assert "slice 1/1: n003 died: signal 9" in said
    assert said.endswith("slice 1/1: 1 of its processes died\n")
    assert sliced.run.finish()[0] == 1


def test_processes_that_die_are_replaced_if_the_scenario_wants_that(tmp_path: Path) -> None:
    sliced = Sliced(tmp_path, 1, *LONG, "--set", "restart=on-death")
    sliced.run.started()
    time.sleep(3)  # steps in which all report
    family = until(lambda: {child.cmdline()[0]: child for child in descendants(sliced.slices[1].process.pid)})
    family["trackfield node n003"].kill()
    family["trackfield router"].kill()
    code, said = sliced.slices[1].finish()
    assert code == 1
    assert "slice 1/1: n003 died: signal 9 (started again)" in said
    assert "slice 1/1: router died: signal 9 (started again)" in said
    assert sliced.run.finish()[0] == 1
    rows = pq.read_table(sliced.run.folder / "messages.parquet").to_pylist()
    assert {row["incarnation"] for row in rows if row["src"] == "n003"} == {0, 1}


def test_without_a_launcher_a_slice_ends(tmp_path: Path) -> None:
    sliced = Sliced(tmp_path, 1, *LONG, "--speed", "0.2")
    sliced.run.started()
    family = descendants(sliced.slices[1].process.pid)
    sliced.run.process.kill()
    code, said = sliced.slices[1].finish()
    assert code == 1
    assert said.endswith("trackfield: the launcher is gone: it was out of reach for 30 s\n")
    assert leftovers(family) == []


# --- one message for what cannot be ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def waiting(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Sliced]:
    """A run of which the second of two slices is missing."""
    sliced = Sliced(tmp_path_factory.mktemp("waiting"), 2, *FIELD, "--wait", "1000", started=[1])
    until(lambda: "of 11 ready, missing " in sliced.run.said() and "n000" not in sliced.run.said().splitlines()[-1])
    yield sliced
    sliced.run.process.send_signal(signal.SIGINT)
    assert sliced.run.finish()[0] == 130
    assert sliced.slices[1].finish()[0] == 0


@pytest.mark.parametrize(
    ("which", "code", "says"),
    [
        ("1/2", 1, r"slice 1/2 is taken: \S+ has it"),
        ("3/2", 2, "there is no slice 3 of 2: they count from 1, or from 0"),
        ("1/3", 2, "this run has 2 slices, not 3"),
        ("auto/3", 2, "this run has 2 slices, not 3"),
    ],
)
def test_a_slice_that_cannot_be_is_refused(waiting: Sliced, which: str, code: int, says: str, tmp_path: Path) -> None:
    one = SliceProcess(tmp_path, which, waiting.endpoint)
    ended, said = one.finish()
    assert ended == code
    assert re.fullmatch(rf"trackfield: .*{says}\n", said), said


def test_a_slice_that_waits_says_once_for_what(waiting: Sliced) -> None:
    one = waiting.start("1/2", name="one-more")
    until(lambda: one.said().endswith("\n"))
    time.sleep(2 * RETRY_S)
    one.kill()
    one.finish()
    why = f"slice 1/2 is taken: {socket.gethostname()} has it"
    assert one.said() == f"waiting: cannot join the run through {waiting.endpoint}: {why}\n"


def test_another_version_is_refused(waiting: Sliced, tmp_path: Path) -> None:
    before = [sys.executable, "-c", OLDER]
    one = SliceProcess(tmp_path, "2/2", waiting.endpoint, before=before)
    code, said = one.finish()
    assert code == 2
    assert re.fullmatch(
        r"trackfield: this run is of Trackfield \S+ \(wire 1\), the slice of 0\.0\.1 \(wire 1\)\n", said
    )


OLDER = """
import sys
from launcher.processes.places import slices
slices.version = lambda _: "0.0.1"
sys.argv = ["trackfield", *sys.argv[sys.argv.index("launcher") + 1:]]
from launcher.cli import main
main()
"""


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--slice", "3", "--connect", "tcp/h:1"), "--slice: is '3'"),
        (("--slice", "1/0", "--connect", "tcp/h:1"), "--slice: is '1/0'"),
        (("--slice", "-1/4", "--connect", "tcp/h:1"), "--slice: is '-1/4'"),
        (("--slice", "1/2", "--connect", "here"), "--connect: is 'here'"),
        (("--slice", "1/2", "--connect", "tls/h:1"), "--connect: tls/h:1 needs certificates; expected --secure"),
        (("--slice", "1/2", "--connect", "tls/h:1", "--secure", "x"), "x/authority.pem: --secure: cannot be read"),
        (("--connect", "tcp/h:1"), "--slice"),
    ],
)
def test_bad_options_have_one_message(trackfield: Call, arguments: tuple[str, ...], says: str) -> None:
    said = trackfield("field", *arguments)
    assert (said.code, says in said.err) == (2, True), said.err


def test_a_field_of_few_has_few_slices(tmp_path: Path) -> None:
    sliced = Sliced(tmp_path, 12, *FIELD, "--wait", "1000", started=[1])
    code, said = sliced.slices[1].finish()
    sliced.run.process.send_signal(signal.SIGINT)
    assert (code, sliced.run.finish()[0]) == (2, 130)
    assert "the number of slices: is 12; expected 1 to 9, as many as there are processes on the field" in said


def test_who_is_missing_when_the_wait_is_over_is_named_by_slices(tmp_path: Path) -> None:
    sliced = Sliced(tmp_path, 2, *FIELD, "--wait", "5", started=[1])
    code, said = sliced.run.finish()
    assert code == 1
    assert f"slice 2/2 missing: {span(blocks_of(2)[2])}" in said
    assert sliced.slices[1].finish()[0] in (0, 1)


def test_any_free_slice_is_given_by_auto(tmp_path: Path) -> None:
    sliced = Sliced(tmp_path, 3, *SHORT, started=[])
    some = [sliced.start("auto/3", name=f"auto{i}") for i in range(3)]
    assert [one.finish()[0] for one in some] == [0, 0, 0], [one.said() for one in some]
    assert sorted(one.joined() for one in some) == ["slice 1/3", "slice 2/3", "slice 3/3"]
    assert sliced.run.finish()[0] == 0


def test_a_run_that_starts_its_own_field_has_no_slices(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    run = Run(tmp_path / "run", *FIELD, "--set", "target.steps=8", "--listen", endpoint)
    run.started()
    code, said = SliceProcess(tmp_path, "1/2", endpoint).finish()
    assert code == 2
    assert "the launcher starts all processes of this run" in said
    assert run.finish()[0] == 0


# --- hosts with clocks of their own -----------------------------------------------------------------------------------


def _unshare() -> str:
    """Why there can be no other clock on this machine, or nothing."""
    if os.geteuid() or not shutil.which("unshare"):
        return "only root has time namespaces"
    tried = subprocess.run(["unshare", "-T", "--monotonic", "9", "true"], capture_output=True, text=True, check=False)
    return tried.stderr.strip()


@pytest.mark.skipif(bool(_unshare()), reason=f"no time namespaces: {_unshare()}")
def test_slices_whose_hosts_have_other_clocks_are_the_same_run(tmp_path: Path) -> None:
    """Their monotonic clocks are 1000 s ahead and 100 s behind: what they send is in time, and in the right order."""
    for speed in SPEEDS:
        home = tmp_path / f"sliced-{speed}"
        sliced = Sliced(home, 3, *SHORT, "--speed", str(speed), started=[1])
        for number, ahead_s in ((2, 1000), (3, -100)):
            before = ("unshare", "-T", "--monotonic", str(ahead_s))
            sliced.slices[number] = sliced.start(f"{number}/3", before=before)
        assert sliced.finish()[0] == 0, sliced.run.said()
        if kept_up(sliced.run.metrics()):
            break
    assert [one.finish()[0] for one in sliced.slices.values()] == [0, 0, 0]
    virtual = Run(tmp_path / "virtual", *SHORT, "--virtual")
    assert virtual.finish()[0] == 0
    assert differences(sliced.run.folder, virtual.folder, 0.0) == []
    assert sliced.run.metrics()["frames"] == virtual.metrics()["frames"]


@pytest.mark.skipif(bool(_unshare()), reason=f"no time namespaces: {_unshare()}")
def test_a_clock_that_is_not_known_well_enough_is_refused(tmp_path: Path) -> None:
    """A run that is so fast that a quarter of its deadline is 25 us, in which no answer comes."""
    fast = ("--set", "fusion.deadline_s=0.01", "--speed", "100")
    sliced = Sliced(tmp_path, 1, *LONG, *fast, "--wait", "1000", started=[])
    one = sliced.start("1/1", before=("unshare", "-T", "--monotonic", "1000"))
    code, said = one.finish()
    sliced.run.process.send_signal(signal.SIGINT)
    assert (code, sliced.run.finish()[0]) == (2, 130)
    assert re.search(r"the clock of this host is known to \d+\.\d+ ms only, and this run bears 0\.0\d ms", said), said


# --- in a secured run -------------------------------------------------------------------------------------------------


def certified(home: Path, slices: int | None) -> Path:
    """A folder with the certificates of a short run of so many slices."""
    home.mkdir(exist_ok=True)
    options = () if slices is None else ("--slices", str(slices))
    command = [sys.executable, "-m", "launcher", "certificates", *SHORT, "--out", str(home / "certificates"), *options]
    subprocess.run(command, check=True, capture_output=True)
    return home / "certificates"


def test_slices_of_a_secured_run_show_their_certificates_or_get_them(tmp_path: Path) -> None:
    """Two have their own, and any third those of a guest; what they do together is refused nowhere."""
    folder = certified(tmp_path, 3)
    secure = ("--secure", "--certificates", str(folder))
    sliced = Sliced(tmp_path, 3, *SHORT, *secure, started=[], protocol="tls")
    slices = [sliced.start(f"{i}/3", "--secure", str(folder)) for i in (1, 2)]
    until(lambda: all(one.joined() for one in slices))  # else any could have theirs
    slices.append(sliced.start("auto/3", "--secure", str(folder / "guest")))
    code, said = sliced.run.finish()
    assert code == 0, said
    assert [one.finish()[0] for one in slices] == [0, 0, 0]
    frames = sliced.run.metrics()["frames"]
    virtual = Run(tmp_path / "virtual", *SHORT, "--virtual")
    assert virtual.finish()[0] == 0
    assert frames["sent"] == virtual.metrics()["frames"]["sent"]
    assert not any(sliced.run.metrics()["interference"].values())


def test_without_certificates_of_slices_a_secured_run_has_none(tmp_path: Path) -> None:
    folder = certified(tmp_path, None)
    secure = ("--secure", "--certificates", str(folder))
    sliced = Sliced(tmp_path, 2, *SHORT, *secure, "--wait", "1000", started=[], protocol="tls")
    code, said = sliced.start("1/2", "--secure", str(folder)).finish()
    sliced.run.process.send_signal(signal.SIGINT)
    assert (code, sliced.run.finish()[0]) == (2, 130)
    says = "this run has no certificates of slices, not of 2: trackfield certificates --slices 2 makes them"
    assert says in said
