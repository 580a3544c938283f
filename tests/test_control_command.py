"""``trackfield control``, and people at the terminal of system control, in runs over processes that go on."""

from __future__ import annotations

import json
import os
import pty
import signal
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from fcntl import LOCK_EX, flock
from pathlib import Path
from threading import Thread
from typing import Any

import pyarrow.parquet as pq
import pytest

from launcher.files import locked
from launcher.plan.bridges import with_terminals
from launcher.plan.prepare import load, planned
from launcher.processes.terminal import at_terminal
from tests.command_line import Call, trackfield
from tests.running import Run, on_time, until
from tests.same_tables import differences
from tests.test_completion import completions, home
from trackfield.drivers.ports import Port
from trackfield.errors import RunFailed
from trackfield.wire import decode
from trackfield.wire.outside import Order, OrderReply

__all__ = ["home", "trackfield"]

SETTINGS = (
    "sensor.waveform=false", "camera.kind=evi-d30", "target.steps=40", "backbone.model=fixed", "backbone.delay_ms=20",
    "backbone.loss=0",
)  # fmt: skip
FIELD = ("yang-ecpa", *(word for one in SETTINGS for word in ("--set", one)))
"""20 s, whose processes have time to hear each other on a busy machine."""
ALL = ["base", "camera-control", "video"]


@pytest.fixture
def settings() -> tuple[str, ...]:
    """What is changed in the field."""
    return ()


@pytest.fixture
def going(tmp_path: Path, settings: tuple[str, ...]) -> Iterator[Run]:
    """A run that goes on, below ``runs/`` of the working directory."""
    (tmp_path / "runs").mkdir()
    changes = [word for one in settings for word in ("--set", one)]
    run = Run(tmp_path / "runs" / "mine", *FIELD, *changes)
    try:
        yield run
    finally:
        run.process.kill()
        run.process.wait()


def table(out: str) -> dict[str, str]:
    """What ``control`` printed: the state of each process."""
    return dict(line.split(maxsplit=1) for line in out.splitlines())


def ordered(folder: Path) -> list[tuple[str, str, Any]]:
    """From whom to whom each order and each reply went."""
    rows = pq.read_table(folder / "messages.parquet").to_pylist()
    found = [row for row in rows if row["kind"] in ("order", "order-reply") and row["outcome"] == "delivered"]
    return [(row["src"], row["dst"], decode(row["payload"])) for row in found]


def by_hand(link: Path, line: bytes, ended: bytes) -> bytes:
    """What somebody sees who types this."""
    file = os.open(link, os.O_RDWR | os.O_NOCTTY)
    try:
        tty.setraw(file)
        os.write(file, line)
        seen = b""
        while ended not in seen:
            seen += os.read(file, 100)
        return seen
    finally:
        os.close(file)


def test_video_is_stopped_and_started_in_a_run(going: Run, trackfield: Call) -> None:
    going.manifest()
    said = trackfield("control", "runs/mine", "status")  # at once: it waits for the start
    assert (said.code, said.err) == (0, "")
    assert table(said.out) == dict.fromkeys(ALL, "running")
    for order, state in (("stop", "stopped"), ("status", "stopped"), ("start", "running")):
        said = trackfield("control", "latest", order, "video")
        assert (said.code, said.out.split(), said.err) == (0, ["video", state], "")
    said = trackfield("control", going.folder, "stop", "vidoe")
    expected = "expected one of base, camera-control, video"
    assert (said.code, said.err) == (
        2, f"trackfield: ID: there is no process vidoe; did you mean video?; {expected}\n"
    )  # fmt: skip
    seen = by_hand(going.folder / "system.tty", b"hello\rstatus\r", b"end\r\n").decode().splitlines()
    assert seen[0] == "not understood: 'hello'; status, status ID, stop ID or start ID is"
    assert sorted(seen[1:-1]) == [f"{id} running" for id in ALL]
    going.process.send_signal(signal.SIGINT)
    assert going.finish()[0] == 130, going.said()
    assert "orders: trackfield control " in going.said()
    assert not (going.folder / "system.tty").is_symlink()
    assert list((going.folder / "logs").glob("system*")) == [] or not (going.folder / "logs/system.log").read_text()
    said = trackfield("control", "runs/mine", "status")
    assert (said.code, said.err) == (
        2, "trackfield: runs/mine: is over; expected a run over processes that goes on\n"
    )  # fmt: skip
    orders = [one for _, _, one in ordered(going.folder) if isinstance(one, Order)]
    replies = [one for _, _, one in ordered(going.folder) if isinstance(one, OrderReply)]
    assert [one.number for one in orders] == list(range(1, 10))
    assert sorted(one.number for one in replies) == [one.number for one in orders]


@pytest.mark.long
@pytest.mark.parametrize("settings", [("restart=on-death",)])
def test_system_control_dies_and_is_asked_again(going: Run, trackfield: Call) -> None:
    """Its next life goes on with the numbers of the one before it: no order of its is refused."""
    going.manifest()
    assert trackfield("control", "latest", "stop", "video").code == 0
    system = going.family()["system"]
    os.kill(system.pid, signal.SIGKILL)
    system.wait(10)
    said = until(lambda: (one := trackfield("control", "latest", "status", "video")).code == 0 and one)
    assert table(said.out) == {"video": "stopped"}
    going.process.send_signal(signal.SIGINT)
    going.finish()
    numbers = [one.number for _, _, one in ordered(going.folder) if isinstance(one, Order)]
    assert len(set(numbers)) == len(numbers) >= 2


@pytest.mark.alone
def test_a_terminal_at_which_nobody_types_changes_nothing(tmp_path: Path) -> None:
    """Frames, tracks and figures are those of virtual time, where there is no terminal."""
    assert Run(tmp_path / "virtual", *FIELD, "--virtual").finish()[0] == 0
    code, said = on_time(tmp_path / "processes", *FIELD, speeds=(1.0, 1.0, 1.0))
    assert code == 0, said
    folders = tmp_path / "virtual", tmp_path / "processes"
    tracks, messages = ([pq.read_table(one / f"{name}.parquet") for one in folders] for name in ("tracks", "messages"))
    assert differences(*tracks, *messages) == ([], [])


# --- wrong inputs ---------------------------------------------------------------------------------------------------


def folder(
    tmp_path: Path, *, speed: float = 1.0, endpoint: str | None = "tcp/127.0.0.1:1", camera: str = "evi-d30"
) -> Path:
    """A folder of a run, as far as ``control`` looks at it."""
    made = tmp_path / "run"
    made.mkdir()
    machine = {"system": "x", "cores": 2, "memory_gb": 1.0}
    manifest = {"command": [], "started": "2026-05-01T10:00:00+00:00", "versions": {}, "machine": machine}
    content = json.dumps(manifest | {"speed": speed, "endpoint": endpoint})
    (made / "manifest.json").write_text(content)
    (made / "scenario.toml").write_text(f'[camera]\nkind = "{camera}"\n' if camera else "")
    return made


GOES_ON = "expected a run over processes that goes on"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("nowhere", "status"), f"nowhere: is no folder of a run; {GOES_ON}"),
        ((".", "status"), f".: has no manifest.json: it is no run; {GOES_ON}"),
        (("latest", "status"), "latest: no run goes on below runs/; expected one, or the folder of a run"),
        ((".", "stp", "video"), "ORDER: unknown order 'stp'; did you mean stop?; expected one of status, start, stop"),
        ((".", "stop"), "ID: stop is for one process; expected the id of a process"),
        ((".", "stop", "two words"), "ID: there is no process 'two words'; expected the id of a process"),
        ((".", "stop", "x\n"), "ID: there is no process 'x\\n'; expected the id of a process"),
    ],
)
def test_what_is_no_order_or_no_run(trackfield: Call, arguments: tuple[str, ...], says: str) -> None:
    said = trackfield("control", *arguments)
    assert (said.code, said.out, said.err) == (2, "", f"trackfield: {says}\n")


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({}, f"run: is over; {GOES_ON}"),
        ({"endpoint": None}, f"run: runs in virtual time, as fast as the machine can; {GOES_ON}"),
        ({"speed": 5.0}, "run: runs at speed 5, and people go by the wall clock; expected a run at speed 1"),
        ({"camera": "none"}, "run: camera.kind: has no system control; expected a run with a camera"),
        ({"camera": ""}, "run: camera.kind: has no system control; expected a run with a camera"),
    ],
)
def test_a_run_in_which_nobody_can_give_orders(
    trackfield: Call, tmp_path: Path, changes: dict[str, Any], says: str
) -> None:
    folder(tmp_path, **changes)
    said = trackfield("control", "run", "status")
    assert (said.code, said.out, said.err) == (2, "", f"trackfield: {says}\n")


def test_a_terminal_that_never_comes(trackfield: Call, tmp_path: Path) -> None:
    with locked(folder(tmp_path)):
        said = trackfield("control", "run", "status", "--timeout", "0.3")
    why = "is not there (its process has not begun, or is on another machine): waited 0.3 s"
    assert (said.code, said.err) == (1, f"trackfield: the terminal of system control, run/system.tty, {why}\n")


def test_a_file_in_the_place_of_the_terminal(trackfield: Call, tmp_path: Path) -> None:
    made = folder(tmp_path)
    (made / "system.tty").write_text("status")
    with locked(made):
        said = trackfield("control", "run", "status")
    assert (said.code, said.err) == (1, "trackfield: run/system.tty is not a terminal\n")


def test_bash_completes_orders_and_runs_that_go_on(home: Path) -> None:
    """The runs of ``home`` are over; one goes on."""
    mine = home / "runs" / "mine"
    mine.mkdir()
    (mine / "manifest.json").write_text(json.dumps({"started": "2026-05-03T10:00:00+00:00"}))
    with locked(mine):
        runs, orders = completions(home, "trackfield control _", "trackfield control latest st")
    assert runs == ["latest", "runs/mine"]
    assert orders == ["status", "start", "stop"]
    assert completions(home, "trackfield control _") == [[]]


@pytest.mark.parametrize(("speed", "device"), [(1.0, "pty:/folder/system.tty"), (5.0, "")])
def test_a_terminal_is_made_where_time_goes_as_for_people(speed: float, device: str) -> None:
    plan = with_terminals(planned(load("yang-ecpa", settings=SETTINGS), speed), Path("/folder"))
    ports = {one.id: one.ports for one in plan.processes if one.ports}
    assert ports == {"system": {"operator": Port(device=device, terminal=True)}}


# --- the terminal ---------------------------------------------------------------------------------------------------


@contextmanager
def somebody(link: Path, answer: Callable[[str], bytes]) -> Iterator[list[str]]:
    """Answers the lines that come to the terminal at ``link``, in the place of system control; those lines."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    link.symlink_to(os.ttyname(theirs))
    came = list[str]()

    def serve() -> None:
        begun = b""
        with suppress(OSError):
            while True:
                begun += os.read(ours, 100)
                *lines, begun = begun.split(b"\n")
                for line in lines:
                    if line:
                        came.append(line.decode())
                        os.write(ours, answer(came[-1]))

    Thread(target=serve, daemon=True).start()
    try:
        yield came
    finally:
        for file in (theirs, ours):
            with suppress(OSError):
                os.close(file)


def replying(*lines: str) -> Callable[[str], bytes]:
    """Answers with these lines, ``#`` in the place of the tag that was asked with."""
    return lambda line: "".join(f"{one.replace('#', line.split()[0])}\r\n" for one in lines).encode()


@pytest.mark.parametrize(
    ("order", "answers", "code", "out", "err"),
    [
        (("status",), ["#0 base stopped", "base running", "# base silent", "# video running", "# end"], 1,
         {"base": "silent", "video": "running"}, ""),
        (("stop", "video"), ["# refused by video, which is running"], 1, {}, "refused by video, which is running"),
        (("status",), ["# refused: 16 orders wait for base already"], 1, {},
         "refused: 16 orders wait for base already"),
        (("status", "video"), ["video running", "#0 video running"], 1, {}, "system control did not answer in time"),
    ],
)  # fmt: skip
def test_answers(
    trackfield: Call, tmp_path: Path, order: tuple[str, ...], answers: list[str], code: int, out: dict[str, str],
    err: str,
) -> None:  # fmt: skip
    """Those to others, who wait no longer, are left out."""
    made = folder(tmp_path)
    with locked(made), somebody(made / "system.tty", replying(*answers)) as came:
        said = trackfield("control", "run", *order, "--timeout", "1")
    assert (said.code, table(said.out), said.err) == (code, out, f"trackfield: {err}\n" if err else "")
    assert [line.split()[1:] for line in came] == [list(order)]


def test_one_person_at_a_time(trackfield: Call, tmp_path: Path) -> None:
    made = folder(tmp_path)
    link = made / "system.tty"
    with locked(made), somebody(link, replying("# video running")):
        file = os.open(link, os.O_RDWR | os.O_NOCTTY)
        flock(file, LOCK_EX)
        said = trackfield("control", "run", "status", "video", "--timeout", "0.3")
        assert (said.code, said.err) == (
            1, "trackfield: the terminal of system control, run/system.tty, is in use by somebody else: waited 0.3 s\n"
        )  # fmt: skip
        os.close(file)
        assert trackfield("control", "run", "status", "video").code == 0


def test_system_control_goes_away(tmp_path: Path) -> None:
    """Nobody waits for an answer that cannot come."""
    link = tmp_path / "system.tty"
    ours, theirs = pty.openpty()
    link.symlink_to(os.ttyname(theirs))
    with at_terminal(link, 30.0, lambda: None) as terminal:
        answers = terminal.ask("status")
        os.close(theirs)
        os.close(ours)
        with pytest.raises(RunFailed, match=r"went away before it had answered|cannot be told anything"):
            next(answers)
