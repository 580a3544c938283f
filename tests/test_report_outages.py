"""A report of what went wrong: a dead centre, gaps of the truth, reports that come too late. Nothing is hidden."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from launcher.report import folder
from launcher.report.figures import FIGURES
from launcher.report.folder import Run, read_run
from launcher.report.outages import outages
from launcher.report.parts import verdicts
from launcher.report.parts.field import fates
from tests import rrd
from tests.reporting import Reader, changed, read, run
from tests.test_report_targets import drawn, labels

OUTAGE = "faults=[{kind='restart', nodes=['fusion'], at_s=3, until_s=9}]"
KILL = "faults=[{kind='kill', nodes=['fusion'], at_s=3}]"


@pytest.fixture(scope="module")
def outage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve steps, during which the centre is away from 3 s to 9 s; it then tells of the step at 8 s, too."""
    return run(tmp_path_factory.mktemp("outage"), OUTAGE)


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A radio so slow that no report can come in time."""
    return run(tmp_path_factory.mktemp("late"), "link.radio=lora868", "link.sf=12")


def alerts(page: Reader) -> int:
    return sum(attributes.get("role") == "alert" for _, attributes in page.tags)


def line_of(axes: Axes, label: str) -> tuple[np.ndarray, np.ndarray]:
    """The x and y of the line of this label."""
    (line,) = [line for line in axes.lines if line.get_label() == label]
    return np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)


# --- an outage --------------------------------------------------------------------------------------------------------


def test_an_outage_is_said_with_its_reason(outage: Path) -> None:
    metrics, page = json.loads((outage / "metrics.json").read_text())["trackers"]["imm-ukf"], read(outage)
    assert "5 s without a track: fusion was restarted at 3 s and came back at 9 s." in page.text
    assert "over 7 of 12 steps (1 of them without a report)" in page.text
    assert "all 12 steps" not in page.text
    assert f"imm-ukf {metrics['verdict']}" in page.text
    assert metrics["verdict"] != "tracked"
    assert "ended early" not in page.text


def test_lines_break_in_every_plot_over_an_outage(outage: Path) -> None:
    found = read_run(outage)
    for name in ("error", "nees"):
        times, values = line_of(drawn(name, found), "imm-ukf")
        assert times.tolist() == list(range(1, 13))
        assert np.isnan(values[2:7]).all()
        assert np.isfinite(values[[0, 1, 7, 11]]).all()
    _, north = line_of(drawn("field", found), "imm-ukf")
    assert np.isnan(north[2:7]).all()


def test_no_report_is_fused_during_an_outage(outage: Path) -> None:
    figure = FIGURES["error"](read_run(outage))
    assert figure is not None
    corners = np.concatenate([path.vertices for path in figure.axes[1].collections[0].get_paths()])
    away = (corners[:, 0] > 3.6) & (corners[:, 0] < 7.4)
    assert away.any()
    assert not corners[away, 1].any()
    assert corners[:, 1].max() >= 3


def test_error_and_bound_are_over_the_same_steps(outage: Path) -> None:
    found = read_run(outage)
    for track in found.tracks:
        both = track.scored & np.isfinite(track.bound)
        error, bound = (float(np.sqrt(np.square(x[both]).mean())) for x in (track.error_m, track.bound))
        assert found.metrics["trackers"][track.tracker]["times_bound"] == pytest.approx(error / bound)
        assert f"{error / bound:.2f} times the bound of {bound:.2f} m over the same steps" in read(outage).text


def test_a_centre_killed_by_plan_ends_no_run(tmp_path: Path) -> None:
    text = read(run(tmp_path / "killed", KILL)).text
    assert "10 s without a track: fusion was killed at 3 s." in text
    assert "over 2 of 12 steps" in text
    assert text.count("Lost by the rule of the scenario") == 2
    assert "ended early" not in text


def test_frames_to_a_dead_centre_are_no_fault_of_the_link(tmp_path: Path) -> None:
    text = read(run(tmp_path / "dead", KILL.replace("at_s=3", "at_s=0.5"))).text
    (frames,) = re.findall(r"None of (\d+) frames arrived \(\1 to a dead receiver\): no tracker had any report\.", text)
    assert int(frames) > 0
    assert "lost on the link" not in text


def test_reports_that_are_lost_explain_a_missing_track(tmp_path: Path) -> None:
    """Without a prior there is no track before a report; here a partition keeps all of them from the centre."""
    cut = "faults=[{kind='partition', nodes=['fusion'], at_s=0, until_s=6.5}]"
    text = read(run(tmp_path / "cut", cut, 'fusion.prior="none"')).text
    assert "6 s without a track: none of 24 reports arrived in time (24 cut off by a partition)." in text


def test_a_smoothed_track_dies_with_the_centre_that_was_still_to_tell_of_it(tmp_path: Path) -> None:
    """Of the steps before the death the smoothed points were not told yet, though all reports had arrived."""
    restart = "faults=[{kind='restart', nodes=['fusion'], at_s=7, until_s=9}]"
    file = run(tmp_path / "smooth", restart, "fusion.smooth_lag=5", steps=16)
    (smoothed,) = [one for one in verdicts.verdicts(read_run(file)) if "+lag5" in one.tracker]
    assert "5 s without a track: fusion was restarted at 7 s and came back at 9 s. " in smoothed.text
    assert "arrived in time" not in read(file).text
    early = changed(file, lambda metrics: metrics.update(ended_s=4.5))
    (track,) = [one for one in early.tracks if one.lag]
    assert outages(early, replace(track, mean=track.mean * np.nan)) == []
    never = run(tmp_path / "never", KILL.replace("at_s=3", "at_s=5.2"), "fusion.smooth_lag=5", steps=12)
    (smoothed,) = [one for one in verdicts.verdicts(read_run(never)) if "+lag5" in one.tracker]
    assert smoothed.text == "No track of the target at any of the 7 steps: fusion was killed at 5.2 s."
    assert json.loads((never / "metrics.json").read_text())["trackers"][smoothed.tracker]["steps_expected"] == 7


def test_what_a_frozen_centre_told_too_late_is_said_and_not_drawn_as_current(tmp_path: Path) -> None:
    """It tells of all steps of the freeze when that ends: no step is without a track."""
    file = run(tmp_path / "frozen", "faults=[{kind='freeze', nodes=['fusion'], at_s=3, until_s=8}]")
    text = read(file).text
    assert (
        text.count("4 steps were published more than a step late, by up to 4.7 s: fusion was frozen from 3 s to 8 s.")
        == 2
    )
    assert re.search(r"\d s without a track", text) is None
    for tracker in ("imm-ukf", "spcpf"):
        at = rrd.read(file / "run.rrd", f"/field/{tracker}/position", "Points2D:positions")
        shown = {t for t, points in at if points}
        gone = [t for t, points in at if not points]
        assert shown == {1, 2, 7, 8, 9, 10, 11, 12}
        assert gone[0] == 3.5


# --- gaps of the truth ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def gappy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recorded path of 20 s, in which the fixes of 8 s are missing."""
    home = tmp_path_factory.mktemp("gappy")
    times = [t for t in range(21) if not 6 < t < 14]
    (home / "ride.csv").write_text("t_s,x,y\n" + "".join(f"{t},{10 * t},{3 * (t % 2)}\n" for t in times))
    settings = ('target.path="file"', f'target.file="{home / "ride.csv"}"')
    return run(home / "run", *settings, scenario="bus", steps=20)


def test_interpolated_truth_stands_apart(gappy: Path) -> None:
    m, text = json.loads((gappy / "metrics.json").read_text())["trackers"]["imm-ukf"], read(gappy).text
    assert "7 of 20 steps (35.0 %) lie in 1 gap of the recorded path" in text
    assert f"over all {m['steps_expected']} steps" in text
    assert m["steps_expected"] == 13
    assert f"not counted above: RMSE {m['gap']['rmse']:.2f} m against a straight line, 7 steps." in text
    assert "RMSE in gaps [m]" in text


def test_a_run_that_ended_before_a_gap_has_none(gappy: Path, tmp_path: Path) -> None:
    copy = Path(shutil.copytree(gappy, tmp_path / "copy"))
    early = changed(copy, lambda metrics: metrics.update(ended_s=5.5))
    assert (early.gaps, early.last_step, len(early.course.at_ns)) == ((), 5, 5)


def test_gaps_are_marked_in_all_plots_over_time_and_pale_in_errors(gappy: Path) -> None:
    found = read_run(gappy)
    for name in ("error", "nees", "losses"):
        axes = drawn(name, found)
        assert "truth interpolated" in labels(axes)
    axes = drawn("error", found)
    _, counted = line_of(axes, "imm-ukf")
    assert np.isnan(counted[6:13]).all()
    assert np.isfinite(counted[[5, 13]]).all()
    assert any(line.get_alpha() and np.isfinite(np.asarray(line.get_ydata())[6:13]).all() for line in axes.lines)


# --- reports that are late --------------------------------------------------------------------------------------------


def test_a_run_in_which_every_report_is_late_says_why(late: Path) -> None:
    page, found = read(late), read_run(late)
    after = found.frames.late_s(found.site.step_ns, 0.3)
    assert np.nanmin(after) > 0
    assert "None of " in page.text
    assert "reports arrived in time" in page.text
    assert "after their deadline, which is 0.3 s after the step." in page.text
    assert "The losses of this run are a fiction" in page.text  # such a radio carries far fewer reports
    assert alerts(page) == 2


def test_sensors_of_late_reports_look_late(late: Path) -> None:
    found = read_run(late)
    names = labels(drawn("field", found))
    assert "report in time" not in names
    assert "reports too late" in names
    assert fates(found)["reports too late"] == found.frames.senders("late")


def test_reports_that_were_late_and_fused_all_the_same_are_no_loss(tmp_path: Path) -> None:
    """None of them comes in time, and the tracks use those that are not too old."""
    slow = ("link.radio=lora868", "link.sf=12", "fusion.max_age_s=3", 'fusion.prior="none"')
    file = run(tmp_path / "patient", *slow)
    found, page = read_run(file), read(file)
    used = {(id, p["step"]) for p in found.points.to_pylist() for id in p["sensors"]}
    outcomes = found.frames.fates(found.frames.reports)
    assert 0 < len(used) < outcomes["late"]
    assert "delivered" not in outcomes
    assert "no tracker had any report" not in page.text
    assert f"; {len(used)} came late and were still fused (fusion.max_age_s)" in page.text
    assert fates(found)["reports late, but fused"] == {id for id, _ in used}
    assert fates(found)["reports too late"] == found.frames.senders("late") - {id for id, _ in used}
    assert "reports late, but fused" in labels(drawn("field", found))


def test_the_deadline_is_in_the_figure_of_latencies(late: Path) -> None:
    assert "deadline, 300 ms after the step" in labels(drawn("latency", read_run(late)))


# --- long runs --------------------------------------------------------------------------------------------------------


def test_a_long_run_has_rolling_errors_and_their_distribution(outage: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(folder, "LONG", 10)
    found: Run = read_run(outage)
    assert found.window == 2
    assert "rms over 2 s" in drawn("error", found).get_ylabel()
    assert "mean over 2 s" in drawn("nees", found).get_ylabel()
    track, (errors, shares) = found.tracks[0], line_of(drawn("distribution", found), "imm-ukf")
    assert shares.max() == pytest.approx(100 * 7 / 12)  # of all expected steps
    assert errors.max() == pytest.approx(np.nanmax(track.error_m))
