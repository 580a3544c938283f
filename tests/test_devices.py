"""Devices that are missing, come and go, take nothing, or are made for the run."""

from __future__ import annotations

import os
import subprocess
import sys
import termios
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from tests.puppet import MS
from tests.running import until
from tests.test_ports import Line
from trackfield.drivers import devices
from trackfield.drivers.devices import MOST_WAITING, Devices
from trackfield.drivers.ports import Port
from trackfield.role import Write

KEY = (5 * MS, 3, 5 * MS, "t")


@pytest.fixture
def line() -> Iterator[Line]:
    with closing(Line()) as line:
        yield line


class At:
    """The device at a port, and what came from it."""

    def __init__(self, device: str | Path, baud: int = 115_200) -> None:
        self.came = b""
        self.devices = Devices({"tty": Port((), str(device), 0, baud)}, self._hear)
        self.devices.open()

    def _hear(self, port: str, data: bytes) -> None:
        assert port == "tty"
        self.came += data

    def write(self, data: bytes) -> None:
        self.devices.write(KEY, Write("tty", data), 0)
        self.devices.release(1, 0)

    def there(self) -> bool:
        return self.devices.there

    def close(self) -> None:
        self.devices.close()


def test_a_terminal_is_raw_and_has_its_baud_rate_and_no_other_process_has_it(line: Line) -> None:
    with closing(At(line.path, 9600)) as one, closing(At(line.path, 1200)) as other:
        until(lambda: one.there() or other.there())
        speed = termios.tcgetattr(line._slave)[5]
        assert speed == (termios.B9600 if one.there() else termios.B1200)
        assert not (one.there() and other.there())
        first, second = (one, other) if one.there() else (other, one)
        first.close()
        until(second.there)


def test_a_baud_rate_that_there_is_not_is_no_crash(line: Line, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr(devices.log, "warning", lambda text, *given: said.append(text % given))
    with closing(At(line.path, -3)):
        assert until(lambda: said)[0].startswith(f"port tty: {line.path} is not there, and waited for (")


def test_a_device_comes_back_and_gets_nothing_that_was_written_while_it_was_away(tmp_path: Path) -> None:
    path = tmp_path / "device"
    with closing(At(path)) as at:
        at.write(b"early")
        for round in (b"1", b"2"):
            with closing(Line()) as line:
                path.symlink_to(line.path)
                until(at.there)
                at.write(b"hello" + round)
                assert until(line.read) == b"hello" + round
                os.write(line.end, round)
                until(lambda seen=round: at.came.endswith(seen))
                path.unlink()
            until(lambda: not at.there())
            at.write(b"lost")
        assert at.came == b"12"
        assert at.devices.lost == 3


def test_a_device_that_takes_nothing_holds_up_nobody(line: Line) -> None:
    """What its terminal does not take waits; beyond that it is lost. Whatever was taken comes whole and in order."""
    piece = bytes(range(256)) * 16
    with closing(At(line.path)) as at:
        until(at.there)
        written = 2 * MOST_WAITING // len(piece)
        for _ in range(written):
            at.write(piece)
        lost = at.devices.lost
        assert 0 < lost < written
        came = b""
        while len(came) < (written - lost) * len(piece):
            came += until(line.read)
    assert came == piece * (written - lost)
    assert at.devices.lost == lost


def test_what_waits_at_the_end_is_lost_if_nobody_takes_it(line: Line, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(devices, "DRAIN_S", 0.1)
    with closing(At(line.path)) as at:
        until(at.there)
        at.write(bytes(MOST_WAITING))
    assert at.devices.lost == 1


def test_a_made_terminal_has_its_link_while_it_is_there(tmp_path: Path) -> None:
    link = tmp_path / "tty"
    link.symlink_to("/dev/pts/left-over")
    with closing(At(f"pty:{link}")) as at:
        until(lambda: link.exists() and "left-over" not in str(link.readlink()))
        at.write(b"nobody")
        for round in (b"1", b"2"):
            with link.open("r+b", buffering=0) as file:
                until(at.there)
                at.write(b"\x03\r\n\x11" + round)  # what a terminal that is not raw would change
                assert file.read(5) == b"\x03\r\n\x11" + round
                file.write(b"\x04\r" + round)
                until(lambda seen=round: at.came.endswith(seen))
            until(lambda: not at.there())
        assert at.came == b"\x04\r1\x04\r2"
    assert not link.is_symlink()
    assert at.devices.lost == 1


def test_a_made_terminal_takes_no_others_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    monkeypatch.setattr(devices.log, "warning", lambda text, *given: said.append(text % given))
    (tmp_path / "tty").write_text("mine")
    with closing(At(f"pty:{tmp_path / 'tty'}")):
        assert "(File exists)" in until(lambda: said)[0]
    assert (tmp_path / "tty").read_text() == "mine"


def test_the_link_of_the_next_life_is_left_alone(tmp_path: Path) -> None:
    link = tmp_path / "tty"
    with closing(At(f"pty:{link}")) as old:
        first = until(link.readlink)
        with closing(At(f"pty:{link}")):
            second = until(lambda: (now := link.readlink()) != first and now)
            old.close()
            assert link.readlink() == second


def test_a_process_without_devices_loads_nothing_for_them() -> None:
    heavy = {"serial", "numpy", "pydantic", "launcher"}
    code = f"""import sys, trackfield.drivers.process, trackfield.protocols.bridge as bridge
bridge.Bridge(peer="base")
print(sorted({heavy} & sys.modules.keys()))"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
