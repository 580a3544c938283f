"""What users see in a browser: a finished run, and one that goes on. The screenshots stay in the tests' folder."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
from pathlib import Path

from launcher.timeline import look
from launcher.timeline.timeline import Timeline
from tests import fake_run
from tests.browser import count, page, shows, with_browser
from tests.running import Run

DEFAULT, SPCPF = (look.tracker_colour(fake_run.info(), tracker) for tracker in fake_run.TRACKERS)
SENT, DELIVERED = look.SERIES["bytes"][1]
WORK = {look.CENTRE: 100, look.STATE_COLOURS["reporting"]: 50, DEFAULT: 50, SPCPF: 50, DELIVERED: 50}
"""Pixels of the fusion centre, of sensors that report, of tracks, ellipses and errors, and of the plot of bytes."""


@with_browser
def test_a_finished_run(tmp_path: Path) -> None:
    info = fake_run.info(side=7)
    timeline = Timeline(tmp_path / "run.rrd", info)
    fake_run.play(timeline, fake_run.calls(info))
    timeline.close()
    command = [sys.executable, "-m", "launcher.cli", "view", "--web", str(tmp_path)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as viewer:
        try:
            assert viewer.stderr is not None
            (address,) = re.findall(r"http://\S+", viewer.stderr.readline())
            with page(address) as shown:
                assert shown.title() == "Rerun Viewer"
                shows(shown, WORK | {look.LOST: 50, look.INFO: 1000}, tmp_path / "finished.png")
        finally:
            viewer.terminate()


@with_browser
def test_a_run_that_goes_on(tmp_path: Path) -> None:
    run = Run(tmp_path / "run", "spcpf", "--nodes", "25", "--live", "--speed", "0.5", "--set", "target.steps=200")
    try:
        run.started()
        (address,) = re.findall(r"live view: (http://\S+)", run.said())
        with page(address) as shown:
            before = shows(shown, WORK, tmp_path / "live.png")
            longer = {DELIVERED: count(before, DELIVERED) * 5 // 4}  # the curve of bytes
            shows(shown, longer, tmp_path / "later.png")
            run.process.send_signal(signal.SIGINT)
            code, said = run.finish()
            shows(shown, longer, tmp_path / "ended.png")  # the page keeps what it got
        assert code == 128 + signal.SIGINT, said
        assert "the live view died" not in said
    finally:
        run.process.kill()
        run.process.wait()
