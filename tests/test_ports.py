"""Bytes at ports: input with its place among events, and output that a device gets once it can no longer be undone."""

from __future__ import annotations

import os
import pty
import time
import tty
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from launcher.run import run_processes
from launcher.show import Quiet
from tests.network import field_of, settle
from tests.puppet import MS, arrival, caught_up, core_of, run, script
from tests.running import until
from tests.test_drivers_agree import both, toy_plan
from tests.toys import Request, party
from trackfield.drivers.devices import Devices
from trackfield.drivers.engine.frames import PortInput, Told, Undone
from trackfield.drivers.ports import Port, inputs
from trackfield.drivers.spec import ProcessSpec, RunSpec, build_core, link_of
from trackfield.role import (
    NS,
    Effect,
    Event,
    Note,
    PortRead,
    Publish,
    Received,
    SetTimer,
    Started,
    Timer,
    TrackPoint,
    Write,
)

START = Started(0)
CALL = Received(2 * MS, Request(1), "peer")


class Echo:
    """Writes back what it reads, with how much it has read so far; publishes that too, so that runs can be compared."""

    kinds = frozenset({"request"})

    def begin(self) -> int:
        return 0

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        if not isinstance(event, PortRead):
            return state, ()
        state += len(event.data)
        point = TrackPoint("hub", "t", event.now, "tracking", (float(state), 0.0, 0.0, 0.0), (0.0,) * 16)
        return state, (Write(event.port, event.data + bytes([state])), Publish(point))


# --- input ------------------------------------------------------------------------------------------------------------


def test_bytes_come_after_the_frames_and_before_the_timers_of_their_instant() -> None:
    core = core_of(script({START: (SetTimer("t", 2 * MS),)}))
    core.offer(PortInput(2 * MS, 0, "tty", b"x"))
    core.offer(arrival(2 * MS, Request(1)))
    run(core, NS)
    assert core.state == (START, CALL, PortRead(2 * MS, "tty", b"x"), Timer(2 * MS, "t"))


def test_bytes_are_read_again_when_a_frame_from_before_turns_up() -> None:
    core = core_of(script({PortRead(3 * MS, "tty", b"x"): (Write("tty", b"y"),), CALL: (Note("called"),)}))
    core.offer(PortInput(3 * MS, 0, "tty", b"x"))
    (wrote,) = [o for o in run(core, NS) if isinstance(o, Told)]
    undone, called, again = caught_up(core, arrival(2 * MS, Request(1)))
    assert isinstance(undone, Undone)
    assert again == wrote
    assert isinstance(called, Told)
    assert core.state == (START, CALL, PortRead(3 * MS, "tty", b"x"))


def test_what_comes_to_a_frozen_process_waits() -> None:
    ports = {"tty": Port(((2 * MS, b"x"),))}
    spec = ProcessSpec("hub", "hub", "tests.test_ports:Echo", freezes=((MS, 5 * MS),), ports=ports)
    run_spec = RunSpec("r", 1, NS, {"model": "ideal"})
    core = build_core(run_spec, spec, link_of(run_spec, []))
    run(core, 4 * MS)
    assert core.state == 0
    run(core, 5 * MS)
    assert core.state == 1


def test_inputs_are_numbered_in_their_order() -> None:
    ports = {"b": Port(((5, b"1"), (3, b"2"))), "a": Port(((3, b"3"),))}
    assert [(one.due_ns, one.number, one.port) for one in inputs(ports)] == [(3, 0, "a"), (3, 1, "b"), (5, 2, "b")]


def test_recorded_input_is_the_same_under_both_drivers(tmp_path: Path) -> None:
    run_spec, processes = party(2, steps=4, link={"model": "fixed", "delay_ms": 4}, speed=2.0)
    reads = tuple((t * 100 * MS, bytes(t % 5 + 1)) for t in range(1, 40))
    hub = replace(processes[0], factory="tests.test_ports:Echo", ports={"tty": Port(reads)})
    real, found = both(toy_plan(run_spec, [hub, *processes[1:]]), tmp_path)
    assert found == []
    assert real.metrics["timing"]["host_late"] == 0
    assert real.metrics["trackers"]["hub"]["sources"] == {"hub": 39}


# --- devices ----------------------------------------------------------------------------------------------------------


class Line:
    """A serial line: its device's path, and what came out at the other end."""

    def __init__(self) -> None:
        self.end, slave = pty.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        self._slave = slave

    def read(self) -> bytes:
        os.set_blocking(self.end, False)
        try:
            return os.read(self.end, 100)
        except BlockingIOError:
            return b""

    def close(self) -> None:
        os.close(self.end)
        os.close(self._slave)


@pytest.fixture
def line() -> Iterator[Line]:
    with closing(Line()) as line:
        yield line


KEY, LATER = (5 * MS, 3, 5 * MS, "t"), (7 * MS, 3, 7 * MS, "t")


@pytest.fixture
def at(line: Line) -> Iterator[Devices]:
    with closing(Devices({"tty": Port((), line.path, 100)}, lambda port, data: None)) as made:
        made.open()
        until(lambda: made.there)
        yield made


def test_a_device_gets_what_was_written_after_the_hold(at: Devices, line: Line) -> None:
    at.write(KEY, Write("tty", b"abc"), 1000)
    assert at.next_ns(0) == 1100
    at.release(1099, 0)
    assert line.read() == b""
    at.release(1100, 0)
    assert until(line.read) == b"abc"
    assert at.next_ns(9) == 9


def test_what_is_undone_within_the_hold_never_leaves(at: Devices, line: Line) -> None:
    at.write(KEY, Write("tty", b"abc"), 1000)
    at.write(LATER, Write("tty", b"def"), 1000)
    at.undo((6 * MS,))
    at.release(2000, 0)
    assert until(line.read) == b"abc"
    assert at.mistaken(NS) == 0


def test_what_first_appears_in_a_replay_leaves(at: Devices, line: Line) -> None:
    at.undo((2 * MS,))
    at.write(KEY, Write("tty", b"abc"), 1000)
    at.release(2000, 0)
    assert until(line.read) == b"abc"


def test_what_has_left_is_not_written_twice_and_counted_if_it_should_not_have(at: Devices, line: Line) -> None:
    at.write(KEY, Write("tty", b"abc"), 1000)
    at.write(LATER, Write("tty", b"def"), 1000)
    at.release(2000, 0)
    read = until(line.read)  # a thread writes one after the other
    assert (read if len(read) == 6 else read + until(line.read)) == b"abcdef"
    at.undo(KEY)
    assert at.mistaken(KEY[0]) == 0  # it may still be written again
    at.write(KEY, Write("tty", b"abc"), 1000)
    assert at.mistaken(LATER[0]) == 0
    assert at.mistaken(LATER[0] + 1) == 1
    at.release(3000, 0)
    time.sleep(0.05)
    assert line.read() == b""


def test_a_device_that_is_not_there_stops_nothing(tmp_path: Path) -> None:
    with closing(Devices({"tty": Port((), str(tmp_path / "none"))}, lambda port, data: None)) as at:
        at.open()
        at.write(KEY, Write("tty", b"abc"), 0)
        at.release(10**12, 0)
        assert at.mistaken(NS) == 0
        assert at.lost == 1


def test_a_device_is_left_alone_until_its_process_lives(line: Line) -> None:
    """A process that lives again would else take what is for the life before it."""
    came: list[bytes] = []
    with closing(Devices({"tty": Port((), line.path)}, lambda port, data: came.append(data))) as at:
        time.sleep(0.05)
        assert not at.there
        at.open()
        at.open()
        until(lambda: at.there)
        os.write(line.end, b"abc")
        assert until(lambda: b"".join(came)) == b"abc"


def test_a_real_device_talks_with_a_process(line: Line, tmp_path: Path) -> None:
    """At speed 1: what is typed at the other end is read, and the answer comes back."""
    run_spec, processes = party(2, steps=6, link={"model": "ideal"})
    hub = replace(processes[0], factory="tests.test_ports:Echo", ports={"tty": Port((), line.path)})
    (tmp_path / "logs").mkdir()
    said: list[bytes] = []

    class Typist(Quiet):
        def running(self, status: dict[str, object]) -> None:
            if len(said) % 4 == 3 and not any(said):  # again: a process that opens its device drops what was there
                os.write(line.end, b"hello")
            said.append(line.read())

    outcome = run_processes(toy_plan(run_spec, [hub, *processes[1:]]), tmp_path, Typist())
    assert outcome.exit_code == 0, outcome.complaints
    answer = b"".join([*said, line.read()])
    letters = bytes(byte for byte in answer if byte in b"hello")
    assert letters[:5] == b"hello"
    assert answer[-1] == len(letters)  # so many were read


def test_ports_work_among_peers_in_any_order() -> None:
    run_spec, processes = party(2, steps=2, link={"model": "ideal"})
    hub = replace(processes[0], factory="tests.test_ports:Echo", ports={"tty": Port(((50 * MS, b"ab"),))})
    field = field_of(run_spec, [hub, *processes[1:]])
    settle(field)
    assert field["hub"].core.state == 2
