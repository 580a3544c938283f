"""Shows the timeline of a run: in the viewer, in a browser, or as a picture made without a screen."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, Final

from launcher.blueprint import EMU
from trackfield.errors import RunFailed, ScenarioError
from trackfield.role import NS

if TYPE_CHECKING:
    from rerun.experimental import Recording, ViewerClient

START_S: Final = 30.0
LOAD_S: Final = 60.0
PAINT_S: Final = 30.0
NO_DRIVER: Final = (
    "the viewer found no Vulkan driver; a picture needs no screen, but Vulkan, which Mesa offers in software "
    "(Debian, Ubuntu: apt install mesa-vulkan-drivers)"
)
_SIGNS_OF_NO_DRIVER: Final = ("Failed to get render context", "No graphics adapter was found")


def open_viewer(run: Path, web: bool = False) -> None:
    """Opens the timeline of a run folder, and returns when the viewer is closed or interrupted.

    With ``web`` the viewer is served to browsers on this machine only; its address goes to stderr.
    Raises ``ScenarioError`` for a folder without a timeline, ``RunFailed`` if the viewer does not come up.
    """
    file, port = str(_timeline(run)), _free_port()
    command = _rerun(file, "--port", str(port))
    if web:
        page = _free_port()
        command += ["--serve-web", "--web-viewer-port", str(page)]
        address = f"http://127.0.0.1:{page}/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A{port}%2Fproxy"
        print(f"The viewer is at {address} (Ctrl-C ends it)", file=sys.stderr)
    with _viewer(command) as process:
        try:
            code = process.wait()
        except KeyboardInterrupt:
            return
    if code:
        raise RunFailed(
            f"the viewer ended with exit code {code}; without a screen try --web or --png FILE",
            process="viewer",
        )


def picture(run: Path, png: Path, at_s: float | None = None) -> None:
    """Saves the timeline of a run folder as a PNG of 1600 x 900, at ``at_s`` (emulated s; None: at 60 %).

    Needs no screen, but a Vulkan driver. Raises ``ScenarioError`` for a folder without a timeline or a file that cannot
    be written, ``RunFailed`` if there is no driver or the viewer fails otherwise.
    """
    timeline = _timeline(run)
    _check_writable(png)
    with headless(timeline) as (viewer, recording):
        if at_s is None:
            emu = next(line for line in recording.timelines if line.name == EMU)
            at_s = 0.6 * (emu.end or 0) / NS
        viewer.run_command("ui.toggle_top_panel")
        viewer.set_time(EMU, duration=at_s, play_state="paused")
        png.write_bytes(_painted(viewer))


@contextlib.contextmanager
def headless(timeline: Path) -> Iterator[tuple[ViewerClient, Recording]]:
    """A viewer without a screen that has loaded this file, and what it loaded; it ends with the context.

    Raises ``RunFailed`` if there is no Vulkan driver or the viewer fails otherwise.
    """
    port = _free_port()
    command = _rerun("--headless", "--port", str(port), "--window-size", "1600x900")
    with tempfile.TemporaryFile() as log, _viewer(command, log) as process:
        try:
            client = _connect(f"rerun+http://127.0.0.1:{port}/proxy", process)
            yield client, _load(client, timeline)
        except (RuntimeError, OSError) as error:
            log.seek(0)
            said = log.read().decode(errors="replace")
            cause = NO_DRIVER if any(sign in said for sign in _SIGNS_OF_NO_DRIVER) else str(error)
            raise RunFailed(f"no picture: {cause}", process="viewer", log=said) from error


def _timeline(run: Path) -> Path:
    file = run / "run.rrd"
    if not file.is_file():
        raise ScenarioError("no timeline here", file=str(run), expected="the folder of a run, with run.rrd in it")
    return file.resolve()


def _check_writable(png: Path) -> None:
    is_new = not png.exists()
    try:
        png.open("ab").close()
    except OSError as error:
        what = f"cannot be written ({error.strerror})"
        raise ScenarioError(what, file=str(png), key="--png", expected="a file in a writable folder") from None
    if is_new:
        png.unlink()


def _free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def _rerun(*options: str) -> list[str]:
    package = importlib.util.find_spec("rerun_cli")
    assert package is not None and package.origin is not None
    # The program itself, not the script of that name: its parent reaps it, and sees its exit code.
    program = str(Path(package.origin).with_name("rerun"))
    # The welcome screen would fetch its examples from the network.
    return [program, "--bind", "127.0.0.1", "--hide-welcome-screen", *options]


@contextlib.contextmanager
def _viewer(command: list[str], log: IO[bytes] | None = None) -> Iterator[subprocess.Popen[bytes]]:
    environment = {"RUST_LOG": "warn", **os.environ, "CI": "1"}  # CI keeps its analytics off
    process = subprocess.Popen(command, stdout=log, stderr=log, env=environment)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def _connect(url: str, process: subprocess.Popen[bytes]) -> ViewerClient:
    from rerun.experimental import ViewerClient

    deadline = time.monotonic() + START_S
    while True:
        try:
            client = ViewerClient.connect(url)
            client.get_state()
            return client
        except (RuntimeError, OSError):
            if process.poll() is not None or time.monotonic() > deadline:
                raise
            time.sleep(0.1)


def _load(client: ViewerClient, timeline: Path) -> Recording:
    client.open(str(timeline))
    deadline = time.monotonic() + LOAD_S
    while True:
        state = client.get_state()
        for recording in state.recordings:
            if not state.loading and any(line.name == EMU for line in recording.timelines):
                return recording
        errors = [entry.message for entry in client.get_logs() if entry.level == "ERROR"]
        if errors or time.monotonic() > deadline:
            raise RuntimeError(errors[0] if errors else f"{timeline} was not loaded within {LOAD_S:g} s")
        time.sleep(0.1)


def _painted(client: ViewerClient) -> bytes:
    """A screenshot once two in a row are the same: the viewer fetches what it shows piece by piece."""
    deadline = time.monotonic() + PAINT_S
    before, shot = b"", client.take_screenshot()
    while shot != before and time.monotonic() < deadline:
        time.sleep(0.2)
        before, shot = shot, client.take_screenshot()
    return shot
