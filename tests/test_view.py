"""The timeline in the real viewer: without a screen, in a browser's server, and where it cannot come up."""

from __future__ import annotations

import os
import re
import signal
import struct
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest
import rerun

from launcher.timeline import look, recording, view
from launcher.timeline.timeline import Timeline
from tests import fake_run
from tests.command_line import Call, trackfield
from tests.running import leftovers, until
from trackfield.errors import RunFailed, ScenarioError
from trackfield.role import NS

__all__ = ["trackfield"]

FOLDERS = (Path("/usr/share/vulkan/icd.d"), Path("/etc/vulkan/icd.d"))
DRIVERS = os.environ.get("VK_DRIVER_FILES") or [file for folder in FOLDERS for file in folder.glob("*.json")]
with_driver = pytest.mark.skipif(not DRIVERS, reason="no Vulkan driver (apt install mesa-vulkan-drivers)")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    info = fake_run.info(gaps=((20.0, 24.0),))
    timeline = Timeline(folder / "run.rrd", info)
    fake_run.play(timeline, fake_run.calls(info))
    timeline.close()
    return folder


def no_viewer_left() -> bool:
    return not [p for p in psutil.Process().children(recursive=True) if p.name() == "rerun"]


@with_driver
def test_every_view_is_there_and_has_nothing_to_complain_of(run: Path) -> None:
    with view.headless(run / "run.rrd") as (viewer, recording):
        (line,) = recording.timelines
        viewer.set_time(look.TIME, duration=36.4, play_state="paused")
        viewer.take_screenshot()
        state = viewer.get_state()
    assert (line.name, line.start, line.end) == (look.TIME, 0, 61 * NS)
    assert {(v.name, v.view_class) for v in state.views} == {
        ("Field (E right, N up)", "2D"),
        ("Close-up of target", "2D"),
        ("Node states", "StateTimeline"),
        ("All states", "StateTimeline"),
        ("Network", "Graph"),
        ("Radio links (reception)", "2D"),
        ("Messages", "TextLog"),
        ("Faults", "TextLog"),
        ("Message times", "Dataframe"),
        ("Error [m]", "TimeSeries"),
        ("Latency [ms]", "TimeSeries"),
        ("Frames lost", "TimeSeries"),
        ("Bytes/s", "TimeSeries"),
        ("Clock error [ms]", "TimeSeries"),
        ("Frames waiting", "TimeSeries"),
    }
    assert [(v.name, v.reports) for v in state.views if v.reports] == []
    assert no_viewer_left()


@with_driver
def test_a_picture_shows_the_moment_asked_for(run: Path, tmp_path: Path) -> None:
    for name, at_s in (("early", 5.0), ("late", 50.0), ("late again", 50.0)):
        view.picture(run, tmp_path / name, at_s)
    early, late, again = ((tmp_path / name).read_bytes() for name in ("early", "late", "late again"))
    assert early[:8] == b"\x89PNG\r\n\x1a\n"
    assert struct.unpack(">II", early[16:24]) == (1600, 900)
    assert min(len(early), len(late)) > 150_000  # an empty window has a tenth of that
    assert early != late
    assert len(late) == pytest.approx(len(again), rel=0.02)
    assert no_viewer_left()


@with_driver
def test_a_picture_needs_no_time(run: Path, tmp_path: Path) -> None:
    view.picture(run, tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 150_000


def test_without_a_vulkan_driver_the_package_is_named(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
        monkeypatch.setenv(name, "/nonexistent")
    with pytest.raises(RunFailed, match="mesa-vulkan-drivers") as failure:
        view.picture(run, tmp_path / "a.png")
    assert failure.value.process == "viewer"
    assert not (tmp_path / "a.png").exists()
    assert no_viewer_left()


@with_driver
@pytest.mark.parametrize("kept", [0.5, 1.0])
def test_of_a_torn_file_that_is_shown_which_is_there(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], kept: float
) -> None:
    whole = (run / "run.rrd").read_bytes()
    torn = whole[: int(kept * len(whole)) - 1]
    (tmp_path / "run.rrd").write_bytes(torn)
    view.picture(tmp_path, tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 100_000
    assert f"{tmp_path / 'run.rrd'} has no end" in capsys.readouterr().err
    assert (tmp_path / "run.rrd").read_bytes() == torn
    assert no_viewer_left()


@pytest.mark.parametrize("kept", [12, 100, 1000, 1300])
def test_a_file_in_which_nothing_happened_yet_is_refused_at_once(run: Path, tmp_path: Path, kept: int) -> None:
    """12 bytes are the head of a file; a file that ends between two parts was waited for until the time was over."""
    (tmp_path / "run.rrd").write_bytes((run / "run.rrd").read_bytes()[:kept])
    (tmp_path / "record.log").touch()
    for act in (lambda: view.open_viewer(tmp_path), lambda: view.picture(tmp_path, tmp_path / "a.png")):
        with pytest.raises(
            ScenarioError, match=r"run\.rrd: is damaged, .*; trackfield recover .* finishes it"
        ) as failure:
            act()
        assert failure.value.file == str(tmp_path / "run.rrd")
    assert not (tmp_path / "a.png").exists()


def slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rerun's program takes longer to read a file than it may."""

    def late(command: list[str], **_: object) -> None:
        raise subprocess.TimeoutExpired(command, recording.CHECK_S)

    monkeypatch.setattr(subprocess, "run", late)


def test_a_whole_file_that_takes_long_to_read_is_shown(
    run: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    slow(monkeypatch)
    with recording.whole(run) as file:
        assert file == (run / "run.rrd").resolve()
    assert capsys.readouterr().err == ""


def test_a_torn_file_that_takes_long_to_read_is_not_called_damaged(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run.rrd").write_bytes((run / "run.rrd").read_bytes()[:-1])
    slow(monkeypatch)
    with pytest.raises(ScenarioError, match="has no end, and what is there could not be read within 120 s"):
        view.open_viewer(tmp_path)


def test_a_whole_file_in_which_nothing_happens_is_refused_at_once(tmp_path: Path) -> None:
    with rerun.RecordingStream("empty") as stream:
        stream.save(tmp_path / "run.rrd")
        stream.log("a", rerun.TextLog("x"), static=True)
        stream.disconnect()
    with pytest.raises(ScenarioError, match="ends before anything happened"):
        view.open_viewer(tmp_path)


def test_a_viewer_that_does_not_answer_ends_in_time(run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is stopped once it runs, so that the first call waits for ever."""

    def stopped(url: str, process: subprocess.Popen[bytes]) -> object:
        client = connect(url, process)
        process.send_signal(signal.SIGSTOP)
        return client

    connect = view._connect
    monkeypatch.setattr(view, "_connect", stopped)
    monkeypatch.setattr(view, "PICTURE_S", 4.0)
    with pytest.raises(RunFailed, match="no picture: the viewer took longer than 4 s"):
        view.picture(run, tmp_path / "a.png")
    assert no_viewer_left()


def test_a_folder_without_a_timeline_is_bad_input(tmp_path: Path) -> None:
    acts: list[Callable[[], None]] = [
        lambda: view.open_viewer(tmp_path),
        lambda: view.open_viewer(tmp_path, web=True),
        lambda: view.picture(tmp_path, tmp_path / "a.png"),
    ]
    for act in acts:
        with pytest.raises(ScenarioError, match=r"run\.rrd") as failure:
            act()
        assert failure.value.file == str(tmp_path)
    (tmp_path / "run.rrd").write_bytes(b"not a recording")
    for act in acts:
        with pytest.raises(ScenarioError, match=r"run\.rrd: is not a timeline"):
            act()


@pytest.mark.skipif(sys.platform == "darwin", reason="there is always a screen")
def test_without_a_screen_only_the_other_ways_are_named(
    trackfield: Call, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in view.SCREENS:
        monkeypatch.delenv(name, raising=False)
    said = trackfield("view", run)
    assert (said.code, said.out) == (1, "")
    assert said.err == f"trackfield: there is no screen to show the timeline on; {view.OTHER_WAYS}\n"
    monkeypatch.setenv("DISPLAY", ":99999")  # nobody there
    said = trackfield("view", run)
    assert (said.code, said.out) == (1, "")
    assert said.err == f"trackfield: the viewer ended with exit code 1; {view.OTHER_WAYS}\n"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--at", "5"), "--at: is for a picture only; expected --png FILE as well"),
        (("--web", "--png", "a.png"), "--web, --png: a picture is not shown in the browser; expected one of them"),
        pytest.param(
            ("--png", "a.png", "--at", "500"),
            "--at: is 500, which the run does not have; expected a second from 0 to 61",
            marks=with_driver,
        ),
    ],
)
def test_options_that_cannot_be_followed_are_refused(
    trackfield: Call, run: Path, options: tuple[str, ...], message: str
) -> None:
    said = trackfield("view", run, *options)
    assert (said.code, said.out, said.err) == (2, "", f"trackfield: {message}\n")
    assert not Path("a.png").exists()


SERVE = """
import pathlib, signal, sys
from launcher.timeline.view import open_viewer
signal.signal(signal.SIGINT, signal.default_int_handler)  # whoever runs the tests may ignore it
open_viewer(pathlib.Path(sys.argv[1]), web=True)
"""


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, -15), (signal.SIGKILL, -9)])
def test_the_web_viewer_serves_this_machine_only_and_ends_with_us(run: Path, number: int, code: int) -> None:
    command = [sys.executable, "-c", SERVE, str(run)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            (address,) = re.findall(r"http://\S+", process.stderr.readline())
            ports = {int(port) for port in re.findall(r"(?::|%3A)(\d+)", address)}
            assert len(ports) == 2
            listening: set[tuple[str, int]] = set()
            while len(listening) < 2:  # until the test's time is up
                time.sleep(0.1)
                (viewer,) = [p for p in psutil.Process(process.pid).children() if p.name() == "rerun"] or [None]
                sockets = viewer.net_connections() if viewer else []
                listening = {socket.laddr for socket in sockets if socket.status == psutil.CONN_LISTEN}
            assert listening == {("127.0.0.1", port) for port in ports}
            with urllib.request.urlopen(address, timeout=10) as answer:
                assert b"Rerun" in answer.read()
        finally:
            process.send_signal(number)
            process.communicate(timeout=10)
    assert process.returncode == code
    assert viewer is not None
    until(lambda: leftovers([viewer]) == [])
