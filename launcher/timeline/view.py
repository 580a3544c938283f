"""Shows the timeline of a run: in the viewer, in a browser, or as a picture that needs no screen."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import IO, TYPE_CHECKING, Final, NamedTuple
from urllib.parse import quote

from launcher.files import check_writable
from launcher.timeline.look import TIME
from launcher.timeline.program import environment, program
from launcher.timeline.recording import timeline_of, whole
from trackfield.errors import RunFailed, ScenarioError
from trackfield.role import NS

if TYPE_CHECKING:
    from rerun.experimental import Recording, ViewerClient

LOOPBACK: Final = "127.0.0.1"
SERVED: Final = "256MiB"
"""Memory for what is shown; of what runs send, the oldest is dropped first."""
START_S: Final = 30.0
LOAD_S: Final = 60.0
PAINT_S: Final = 30.0
PICTURE_S: Final = 120.0
"""The longest that a picture takes, whatever the viewer does."""
NO_DRIVER: Final = (
    "the viewer found no Vulkan driver; a picture needs no screen, but it needs Vulkan, which Mesa offers in software "
    "(Debian, Ubuntu: apt install mesa-vulkan-drivers)"
)
OTHER_WAYS: Final = "--web shows it in a browser, --png FILE writes a picture of it"
SCREENS: Final = ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")
_LIBC: Final = ctypes.CDLL(None)
_PR_SET_PDEATHSIG: Final = 1
_SIGNS_OF_NO_DRIVER: Final = ("Failed to get render context", "No graphics adapter was found")


class Served(NamedTuple):
    """Where a viewer is served to browsers: the address of this machine, and the ports of the page and of its data."""

    address: str = LOOPBACK
    ports: tuple[int, int] | None = None
    """None: two that are free."""


HERE: Final = Served()


def open_viewer(run: Path | None, web: bool = False, served: Served = HERE) -> None:
    """Opens the timeline of a run folder, and returns when the viewer is closed or interrupted.

    With ``web`` the viewer is ``served`` to browsers, on this machine only unless that says otherwise; its address goes
    to stderr. If ``run`` is None, it shows what runs send. Raises ``ScenarioError`` for a folder without a timeline,
    ``RunFailed`` if the viewer does not start.
    """
    with nullcontext() if run is None else whole(run) as file:
        _open(file, web, served)


def _open(file: Path | None, web: bool, served: Served) -> None:
    page, port = served.ports or (free_port(), free_port())
    if web:
        ports = ("--web-viewer-port", str(page), "--port", str(port))
        shown = ("--server-memory-limit", SERVED) if file is None else (str(file),)
        command = _rerun("--serve-web", *ports, *shown, address=served.address)
        print(f"The viewer is at {page_address(page, port)} (Ctrl-C ends it)", file=sys.stderr)
    elif not _has_screen():
        raise RunFailed(f"there is no screen to show the timeline on; {OTHER_WAYS}", process="viewer")
    else:
        command = _rerun("--port", str(port), str(file))
    with tempfile.TemporaryFile() as log, _viewer(command, None if web else log) as process:
        try:
            code = process.wait()
        except KeyboardInterrupt:
            return
        log.seek(0)
        said = log.read().decode(errors="replace")
    if code:
        raise RunFailed(f"the viewer ended with exit code {code}; {OTHER_WAYS}", process="viewer", log=said)


def _has_screen() -> bool:
    """Whether a window can be opened; only on Linux is this known in advance."""
    return sys.platform != "linux" or any(os.environ.get(name) for name in SCREENS)


def page_address(page: int, port: int) -> str:
    """Where a browser finds the viewer, served at port ``page``, with what is served at ``port`` in it."""
    return f"http://{LOOPBACK}:{page}/?url={quote(_source(port), safe='')}&theme=dark&hide_welcome_screen"


def web_server(page: int, port: int) -> list[str]:
    """The command that serves the viewer at port ``page``, for a recorder that serves a timeline at ``port``."""
    return _rerun("--serve-web", "--web-viewer-port", str(page), _source(port))


def free_port() -> int:
    """A free port of this machine."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def picture(run: Path, png: Path, at_s: float | None = None) -> None:
    """Saves the timeline of a run folder as a PNG of 1600 x 900, at ``at_s`` (emulated s; None: at 60 %).

    Needs no screen, but a Vulkan driver. Raises ``ScenarioError`` for a folder without a timeline, a time that the run
    does not have or a file that cannot be written, ``RunFailed`` if there is no driver or the viewer fails otherwise,
    or takes longer than ``PICTURE_S``.
    """
    timeline_of(run)
    check_writable(png, "--png")
    with whole(run) as timeline, headless(timeline) as (viewer, recording):
        first_s, last_s = _span(recording)
        if at_s is None:
            at_s = 0.6 * last_s
        if not first_s <= at_s <= last_s:
            expected = f"a second from {first_s:g} to {last_s:g}"
            raise ScenarioError(f"is {at_s:g}, which the run does not have", key="--at", expected=expected)
        viewer.run_command("ui.toggle_top_panel")
        viewer.set_time(TIME, duration=at_s, play_state="paused")
        png.write_bytes(_painted(viewer))


@contextlib.contextmanager
def headless(timeline: Path) -> Iterator[tuple[ViewerClient, Recording]]:
    """A viewer without a screen that has loaded this file, and what it loaded; it ends with the context.

    Raises ``RunFailed`` if there is no Vulkan driver or the viewer fails otherwise.
    """
    port = free_port()
    command = _rerun("--headless", "--port", str(port), "--window-size", "1600x900")
    with tempfile.TemporaryFile() as log, _viewer(command, log) as process, _until(PICTURE_S, process) as late:
        try:
            client = _connect(_source(port), process)
            yield client, _load(client, timeline)
        except (RuntimeError, OSError) as error:
            log.seek(0)
            said = log.read().decode(errors="replace")
            cause = NO_DRIVER if any(sign in said for sign in _SIGNS_OF_NO_DRIVER) else str(error)
            if late:
                cause = f"the viewer took longer than {PICTURE_S:g} s"
            raise RunFailed(f"no picture: {cause}", process="viewer", log=said) from error


def source(at: str) -> str:
    """The address at which a viewer or its server (``HOST:PORT``) takes and gives what is shown."""
    return f"rerun+http://{at}/proxy"


def _source(port: int) -> str:
    return source(f"{LOOPBACK}:{port}")


def _rerun(*options: str, address: str = LOOPBACK) -> list[str]:
    # The welcome screen would fetch its examples from the network.
    return [str(program()), "--bind", address, "--hide-welcome-screen", *options]


@contextlib.contextmanager
def _viewer(command: list[str], log: IO[bytes] | None = None) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen(
        command,
        stdout=log,
        stderr=log,
        env=environment(),
        preexec_fn=_end_with_parent,  # noqa: PLW1509  one system call, which threads do not mind
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@contextlib.contextmanager
def _until(limit_s: float, process: subprocess.Popen[bytes]) -> Iterator[list[str]]:
    """End a process that takes longer, so that whoever waits for its answer gets an error; the list says if so."""
    late: list[str] = []

    def end() -> None:
        late.append("late")
        process.kill()

    timer = threading.Timer(limit_s, end)
    timer.start()
    try:
        yield late
    finally:
        timer.cancel()


def _end_with_parent() -> None:
    """Let Linux end this process when its parent dies, for example by a signal."""
    if sys.platform == "linux":
        _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


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


def _span(recording: Recording) -> tuple[float, float]:
    """The first and the last second of a recording."""
    line = next(line for line in recording.timelines if line.name == TIME)
    return (line.start or 0) / NS, (line.end or 0) / NS


def _load(client: ViewerClient, timeline: Path) -> Recording:
    client.open(str(timeline))
    deadline = time.monotonic() + LOAD_S
    while True:
        state = client.get_state()
        for recording in state.recordings:
            if not state.loading and any(line.name == TIME for line in recording.timelines):
                return recording
        errors = [entry.message for entry in client.get_logs() if entry.level == "ERROR"]
        if errors or time.monotonic() > deadline:
            raise RuntimeError(errors[0] if errors else f"{timeline} was not loaded within {LOAD_S:g} s")
        time.sleep(0.1)


def _painted(client: ViewerClient) -> bytes:
    """A screenshot, once two in a row are the same: the viewer loads what it shows piece by piece."""
    deadline = time.monotonic() + PAINT_S
    before, shot = b"", client.take_screenshot()
    while shot != before and time.monotonic() < deadline:
        time.sleep(0.2)
        before, shot = shot, client.take_screenshot()
    return shot
