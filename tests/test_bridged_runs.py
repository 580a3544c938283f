"""Runs over Zenoh in which a small program at the other end of a terminal has the place of a process."""

from __future__ import annotations

import json
import os
import pty
import tty
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest

import trackfield as tf
from launcher.plan.architectures import ARCHITECTURES
from tests.bridged import Answer, Lined, Question
from tests.command_line import Call, Said, trackfield
from tests.running import PATIENCE_S, until
from tests.test_bridge import NOISE, SMALL, line_of
from trackfield.wire import decode, line

__all__ = ["trackfield"]

STEP = 100
"""By how much more the program answers than was asked: the emulated gauge answers with the next number."""
NOBODY = "gauge.tty is not there, and waited for (nobody has it open)"


@pytest.fixture(autouse=True)
def lined() -> Iterator[None]:
    tf.register_architecture("own", Lined)
    yield
    ARCHITECTURES.registered.clear()


def run(trackfield: Call, device: str) -> Said:
    """A run of some seconds at speed 1 with this device in the place of the gauge."""
    settings = [word for key, value in SMALL.items() for word in ("--set", f"{key}={value}")]
    return trackfield("run", "zhai-spcpf", *settings, "--bridge", f"gauge={device}", "--out", "out")


class Program:
    """Answers questions that come from ``file``, as a gauge does, until there is nobody who asks."""

    def __init__(self, file: int) -> None:
        self.file, self.asked = file, list[int]()
        self.over = Event()

    def serve(self) -> None:
        begun = b""
        with suppress(OSError):  # the other end is gone
            while not self.over.is_set() and (data := os.read(self.file, 100)):
                begun, lines = line.split(begun, data)
                for one in lines:
                    question = decode(line.unframed(one))
                    assert isinstance(question, Question)
                    self.asked.append(question.number)
                    os.write(self.file, line_of(Answer(question.number + STEP)))


def told(out: Path) -> tuple[list[int], list[int]]:
    """The questions that the desk asked, and the answers that it was given."""
    rows = tf.open(out).messages.to_pylist()
    lines = [row for row in rows if row["medium"] == "serial" and row["dst"] in ("desk", "gauge")]
    assert {row["outcome"] for row in lines} <= {"delivered", "in_flight"}
    arrived = [(row["src"], decode(row["payload"]).number) for row in lines if row["outcome"] == "delivered"]
    return [number for src, number in arrived if src == "desk"], [number for src, number in arrived if src == "gauge"]


def noted(out: Path) -> Any:
    return json.loads((out / "metrics.json").read_text())["processes"]["unwritten"]


def late(out: Path) -> Any:
    """How much came too late; what had left for the device by then could not be taken back."""
    return json.loads((out / "metrics.json").read_text())["timing"]["host_late"]


def test_a_program_at_a_pseudo_terminal_talks_with_a_process(trackfield: Call, tmp_path: Path) -> None:
    """Both ways, in spite of noise; what was sent before it came is lost, and counted."""
    out, programs = tmp_path / "out", list[Program]()

    def attend() -> None:
        until(lambda: NOBODY in (out / "logs" / "gauge.log").read_text())
        file = until(lambda: os.open(out / "gauge.tty", os.O_RDWR | os.O_NOCTTY))
        programs.append(Program(file))
        os.write(file, NOISE + bytes(9) + b"half a line" * 500)
        os.write(file, line.END + line_of(Answer(STEP)))
        programs[0].serve()
        os.close(file)

    thread = Thread(target=attend)
    thread.start()
    said = run(trackfield, "pty")
    thread.join(PATIENCE_S)
    assert said.code == 0, said.err
    assert f"in the place of gauge: {Path('out') / 'gauge.tty'}\n" in said.err
    assert not (out / "gauge.tty").is_symlink()
    asked, answered = told(out)
    assert asked == sorted(asked)
    assert asked[-1] >= 3 * STEP  # each answer made the next question
    assert answered[0] == STEP
    assert set(answered[1:]) <= {number + STEP for number in programs[0].asked}
    assert len(set(programs[0].asked) - set(asked)) <= late(out)
    assert len(asked) + late(out) >= len(programs[0].asked) + noted(out)
    log = (out / "logs" / "gauge.log").read_text()
    assert NOBODY in log
    assert "gauge.tty is there" in log
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["bridges"] == {"gauge": "pty"}
    assert "in the place of gauge" in (out / "report.html").read_text()


def test_what_a_radio_brings_to_the_place_of_a_device_is_lost_and_accounted_for(
    trackfield: Call, tmp_path: Path
) -> None:
    """Nobody is at the line either: all that is asked there is missed."""
    tf.register_architecture("own", lambda: Lined(gauge=("field", "serial")))
    said = run(trackfield, "pty")
    assert said.code == 0, said.err
    metrics = json.loads((tmp_path / "out" / "metrics.json").read_text())
    frames, asked = metrics["frames"], told(tmp_path / "out")[0]
    assert frames["lost"]["asleep"] == frames["by_kind"]["hello"]["sent"] > 0
    assert metrics["timing"]["unsettled"] == 0
    assert metrics["processes"]["unwritten"] == len(asked) > 0
    assert set(asked) == {0}


class Plug:
    """A device that can be unplugged, and whose path stays the same."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.plug()

    def plug(self) -> None:
        self.end, other = pty.openpty()
        tty.setraw(other)
        self.path.symlink_to(os.ttyname(other))
        self._other: int | None = other

    def handed_over(self) -> None:
        """The process has it open now."""
        if self._other is not None:
            os.close(self._other)
            self._other = None

    def unplug(self) -> None:
        self.path.unlink()
        self.handed_over()
        os.close(self.end)

    def close(self) -> None:
        with suppress(OSError):
            self.unplug()


def test_a_device_is_unplugged_and_comes_back(trackfield: Call, tmp_path: Path) -> None:
    """The run goes on; what is sent meanwhile is lost and counted, and afterwards all is as before."""
    out, programs = tmp_path / "out", list[Program]()

    def serve(plug: Plug, questions: int) -> None:
        programs.append(program := Program(plug.end))
        thread = Thread(target=program.serve)
        thread.start()
        until(lambda: len(program.asked) >= questions)
        program.over.set()  # it ends with the next question
        thread.join(30)

    def attend(plug: Plug) -> None:
        serve(plug, 2)
        plug.unplug()
        until(lambda: "lost" in (out / "logs" / "gauge.log").read_text())
        plug.plug()
        serve(plug, 2)

    with closing(Plug(tmp_path / "device")) as plug:
        thread = Thread(target=attend, args=(plug,))
        thread.start()
        said = run(trackfield, str(plug.path))
        thread.join(PATIENCE_S)
    assert said.code == 0, said.err
    first, second = (program.asked for program in programs)
    asked, _ = told(out)
    assert len(first) >= 2
    assert len(second) >= 2
    assert second[-1] > first[-1]
    assert noted(out) >= 1
    assert len(asked) + late(out) >= len(first) + len(second) + noted(out)
    log = (out / "logs" / "gauge.log").read_text()
    assert log.count(f"{plug.path} is there") == 2
    assert log.count(f"{plug.path} is not there, and waited for") >= 1
    assert "its device is not there" in log
    assert f"its device missed {noted(out)} of what was written" in log
