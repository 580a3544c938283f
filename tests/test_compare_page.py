"""What ``compare`` writes: the page, CSV, JSON, the recording; and what it refuses to write."""

from __future__ import annotations

import base64
import csv
import io
import json
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image
from playwright.sync_api import sync_playwright

import trackfield as tf
from launcher.colours import tracker_colours
from launcher.report import style
from launcher.report.folder import read_run
from launcher.study.comparison import figures
from launcher.study.comparison.lines import lines, panels, tint
from launcher.study.comparison.maps import furthest
from launcher.study.comparison.paired import paired
from launcher.study.comparison.runs import read_runs
from tests.browser import CHROMIUM, with_browser
from tests.command_line import Call, trackfield
from tests.reporting import Reader, run
from tests.rrd import entities, read, verify

__all__ = ["trackfield"]

OUTAGE = "faults=[{kind='restart', nodes=['fusion'], at_s=4, until_s=9}]"
KILL = "faults=[{kind='kill', nodes=['fusion'], at_s=%g}]"


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs: ``a``, ``out`` with an outage of its centre, ``killed`` and ``dead`` whose centre dies at 6 s and before
    the first step, and ``other`` on a shorter path of its own."""
    home = tmp_path_factory.mktemp("runs")
    run(home / "a")
    run(home / "out", OUTAGE)
    run(home / "killed", KILL % 6, "energy.sample_mj=50")
    run(home / "dead", KILL % 0.5, "energy.sample_mj=50")
    run(home / "other", "target.path=s2", 'fusion.trackers=["ekf"]', steps=8)
    return home


def page(trackfield: Call, tmp_path: Path, *arguments: object) -> tuple[Reader, int]:
    said = trackfield("compare", *arguments, "--html", "page.html")
    assert "page: page.html\n" in said.err
    return Reader((tmp_path / "page.html").read_text()), said.code


# --- the page ---------------------------------------------------------------------------------------------------------


def test_the_page_says_what_differs_and_what_came_of_it(trackfield: Call, tmp_path: Path, home: Path) -> None:
    read, code = page(trackfield, tmp_path, home / "a", home / "out")
    assert code == 0
    assert "a, out – Trackfield comparison" in read.text
    assert 'faults – [{"kind": "restart", "nodes": ["fusion"], "at_s": 4.0, "until_s": 9.0}]' in read.text
    assert re.search(r"imm-ukf a tracked RMSE [\d.]+ m, .* over all 12 steps", read.text)
    assert re.search(r"out (lost|tracked with gaps) RMSE [\d.]+ m, .* over 8 of 12 steps", read.text)
    assert "4 s without a track: fusion was restarted at 4 s and came back at 9 s" in read.text
    assert "a lower figure may be chance" in read.text
    headings = [
        "Runs",
        "Tracks",
        "Error over time",
        "Error distribution",
        "Step by step",
        "Figures",
        "Messages",
        "Energy",
    ]
    at = [read.text.index(f" {heading} ") for heading in headings]
    assert at == sorted(at)


@pytest.mark.rendered
def test_the_page_needs_nothing_else(trackfield: Call, tmp_path: Path, home: Path) -> None:
    read, _ = page(trackfield, tmp_path, home / "a", home / "out")
    pictures = [attributes["src"] or "" for tag, attributes in read.tags if tag == "img"]
    assert len(pictures) == 5
    for source in pictures:
        picture = Image.open(io.BytesIO(base64.b64decode(source.removeprefix("data:image/png;base64,"))))
        assert picture.width > 1000
    asked = [value for _, attributes in read.tags for key, value in attributes.items() if key in ("src", "href")]
    assert all((value or "").startswith("data:") for value in asked)


def test_each_tracker_has_its_colour_on_the_page(trackfield: Call, tmp_path: Path, home: Path) -> None:
    page(trackfield, tmp_path, home / "a", home / "out")
    text = (tmp_path / "page.html").read_text()
    for tracker, colour in tracker_colours(["imm-ukf", "spcpf"]).items():
        assert re.search(rf'<li style="border-color:{colour}"><h2>{tracker}', text)


def test_runs_of_other_targets_are_compared_in_what_can_be(trackfield: Call, tmp_path: Path, home: Path) -> None:
    read, _ = page(trackfield, tmp_path, home / "a", home / "other")
    assert "different paths" in read.text
    assert "(a 12 s, other 8 s)" in read.text
    assert "Step by step" not in read.text
    assert sum(tag == "img" for tag, _ in read.tags) == 6  # each path has a map of its own
    assert "ekf" in read.text


@pytest.mark.parametrize("name", ["killed", "dead"])
def test_a_run_whose_centre_died_is_as_long_and_has_the_same_target(
    trackfield: Call, tmp_path: Path, home: Path, name: str
) -> None:
    read, _ = page(trackfield, tmp_path, home / "a", home / name)
    assert "not equally long" not in read.text
    assert "different paths" not in read.text
    assert re.findall(r"virtual time ([\d.]+ s)", read.text) == ["12 s", "12 s"]
    sums = re.search(r"<tr><th[^>]*>energy \[J\].*", (tmp_path / "page.html").read_text())
    assert sums is not None
    assert 'class="best"' in sums[0]


@pytest.mark.parametrize(
    ("tolerance", "code", "said"), [("0", 1, "not equal to within 0:"), ("0", 0, "equal to within 0,")]
)
def test_the_page_says_whether_runs_are_equal(
    trackfield: Call, tmp_path: Path, home: Path, tolerance: str, code: int, said: str
) -> None:
    other = home / "out"
    if not code:
        assert trackfield("run", home / "a" / "scenario.toml", "--virtual", "--quiet", "--out", "again").code == 0
        other = tmp_path / "again"
    read, ended = page(trackfield, tmp_path, home / "a", other, "--exact", tolerance)
    assert (ended, f"The runs are {said}" in read.text) == (code, True)


def test_runs_in_which_nothing_was_tracked_have_a_page(trackfield: Call, tmp_path: Path) -> None:
    for name, spacing in (("x", "1"), ("y", "0.9")):
        run(tmp_path / name, f"link.loss={spacing}", "link.model=fixed", "fusion.prior=none", steps=3)
    read, _ = page(trackfield, tmp_path, tmp_path / "x", tmp_path / "y")
    assert re.findall(r"\b([xy]) lost No track of the target at any of the 3 steps", read.text) == ["x", "y"] * 2
    assert read.text.count("verdict lost lost") == 2


# --- figures ----------------------------------------------------------------------------------------------------------


def test_lines_of_a_tracker_have_its_colour_and_runs_are_told_apart(home: Path) -> None:
    runs = [read_run(home / name) for name in ("a", "out")]
    found = lines(runs, ["a", "out"])
    figure = figures.errors(found)
    assert figure is not None
    drawn = {line.get_label(): line for line in figure.axes[0].get_lines()}
    own = tracker_colours(["imm-ukf", "spcpf"])
    assert list(drawn) == ["imm-ukf, a", "spcpf, a", "imm-ukf, out", "spcpf, out"]
    assert drawn["spcpf, a"].get_color() == own["spcpf"]
    assert drawn["spcpf, out"].get_color() == tint(own["spcpf"], -0.5)
    assert drawn["spcpf, a"].get_linestyle() != drawn["spcpf, out"].get_linestyle()


def test_a_line_breaks_in_an_outage_and_its_steps_count(home: Path) -> None:
    runs = [read_run(home / name) for name in ("a", "out")]
    found = lines(runs, ["a", "out"])
    over_time, shares = figures.errors(found), figures.distribution(found)
    assert over_time is not None
    assert shares is not None
    for axes, name in ((over_time.axes[0], "imm-ukf, out"), (shares.axes[0], "imm-ukf, out")):
        (line,) = [one for one in axes.get_lines() if one.get_label() == name]
        x, y = (np.asarray(values, float) for values in line.get_data())
        if axes in over_time.axes:
            assert np.isnan(y[(x >= 4) & (x < 8)]).all()
            assert np.isfinite(y[x < 4]).all()
        else:
            assert y.max() == pytest.approx(100 * 8 / 12)


def test_errors_of_a_short_run_beside_a_long_one_are_over_the_same_window(
    monkeypatch: pytest.MonkeyPatch, home: Path
) -> None:
    monkeypatch.setattr("launcher.report.folder.LONG", 10)  # of which ``a`` has more steps, ``other`` less
    runs = [read_run(home / name) for name in ("a", "other")]
    assert [run.long for run in runs] == [True, False]
    figure = figures.errors(lines(runs, ["a", "other"]))
    assert figure is not None
    assert figure.axes[0].get_ylabel() == f"position error [m],\nrms over {runs[0].window} s"
    (line,) = [one for one in figure.axes[0].get_lines() if one.get_label() == "ekf, other"]
    expected = style.rolling_rms(runs[1].tracks[0].error_m, runs[0].window)
    assert np.asarray(line.get_ydata(), float) == pytest.approx(expected)
    assert expected != pytest.approx(runs[1].tracks[0].error_m)


def test_many_lines_have_a_plot_for_each_tracker(home: Path) -> None:
    runs = [read_run(home / "a")] * 4
    plots = panels(lines(runs, ["r", "s", "t", "u"]))
    assert [{line.track.tracker for line in plot} for plot in plots] == [{"imm-ukf"}, {"spcpf"}]
    assert len(panels(lines(runs[:3], ["r", "s", "t"]))) == 1


def test_the_close_up_is_where_two_runs_are_furthest_apart(home: Path) -> None:
    runs = [read_run(home / name) for name in ("a", "out")]
    apart = furthest(lines(runs, ["a", "out"]))
    assert apart is not None
    distances = []
    for one, other in zip(runs[0].tracks, runs[1].tracks, strict=True):
        distances.append(np.nanmax(np.hypot(*(one.mean - other.mean)[:, :2].T)))
    assert apart.distance_m == pytest.approx(max(distances))
    assert furthest(lines([runs[0]] * 2, ["a", "again"])) is None


def test_step_by_step_the_runs_are_paired(home: Path) -> None:
    runs = [read_run(home / name) for name in ("a", "out")]
    table = paired(lines(runs, ["a", "out"]))
    row = dict(zip(table.head, table.rows[0], strict=True))
    a, out = (one.tracks[0].error_m for one in runs)
    both = np.isfinite(a - out)
    assert (row["tracker"], row["run"], row["against"], row["steps in both"]) == ("imm-ukf", "out", "a", "8")
    assert float(row["difference [m]"]) == pytest.approx(float((out - a)[both].mean()), rel=5e-3)
    assert row["parts lower"] == "–"  # too few steps


def test_the_study_that_a_comparison_recommends_can_be_run(trackfield: Call, tmp_path: Path) -> None:
    for name, sync in (("on", "true"), ("off", "false")):
        run(tmp_path / name, f"clock.sync={sync}", "clock.offset_ms=5", steps=3)
    said = " ".join(trackfield("compare", "on", "off").out.split())
    (command,) = re.findall(r"`trackfield (study [^`]+)`", said)
    assert "--seeds 20 --vary clock.sync=true,false" in command
    study = trackfield(*shlex.split(command.replace("--seeds 20", "--seeds 2")))
    assert (study.code, "study: runs/" in study.err) == (0, True)


def test_of_many_runs_figures_and_the_recording_have_the_first_and_tables_all(
    trackfield: Call, tmp_path: Path, home: Path
) -> None:
    names = list("stuvwxyz")
    for name in names:
        shutil.copytree(home / "a", name)
    said = trackfield("compare", *names, "--html", "page.html", "--rrd", "all.rrd")
    assert said.code == 0
    read = Reader((tmp_path / "page.html").read_text())
    assert "Figures of tracks and errors show the first runs only, without y, z; tables and bars show all." in read.text
    assert re.findall(r"spcpf (\w) s 12 0", read.text) == names[1:]  # step by step: each run against the first
    assert "recording: all.rrd\nnote: the recording has the first 6 runs, without y, z\n" in said.err
    shown = {entity.rpartition("/")[2] for entity in entities(tmp_path / "all.rrd") if "/error/spcpf/" in entity}
    assert shown == set(names[:6])


# --- data -------------------------------------------------------------------------------------------------------------


def test_json_has_the_figures_under_the_keys_of_metrics(trackfield: Call, home: Path) -> None:
    said = trackfield("compare", home / "a", home / "out", "--json", "--exact", "0")
    found = json.loads(said.out)
    assert said.code == 1
    assert [one["run"] for one in found["runs"]] == ["a", "out"]
    for one in found["runs"]:
        assert one["metrics"] == json.loads((home / one["run"] / "metrics.json").read_text())
    assert found["settings"]["faults"]["a"] is None
    assert found["settings"]["faults"]["out"][0]["kind"] == "restart"
    assert found["exact"]["equal"] is False
    assert all(line in said.err for line in found["exact"]["differences"])
    assert json.loads(trackfield("compare", home / "a", home / "out", "--json").out)["exact"] is None


def test_csv_has_a_row_for_each_run_and_tracker(trackfield: Call, tmp_path: Path, home: Path) -> None:
    said = trackfield("compare", home / "a", home / "out", home / "other", "--csv", "table.csv")
    assert "table: table.csv\n" in said.err
    rows = list(csv.DictReader(io.StringIO((tmp_path / "table.csv").read_text())))
    assert [(row["run"], row["tracker"]) for row in rows] == [
        ("a", "imm-ukf"), ("a", "spcpf"), ("out", "imm-ukf"), ("out", "spcpf"), ("other", "ekf"),
    ]  # fmt: skip
    for row in rows:
        metrics = json.loads((home / row["run"] / "metrics.json").read_text())
        tracker = metrics["trackers"][row["tracker"]]
        assert float(row["rmse.position"]) == tracker["rmse"]["position"]
        assert row["verdict"] == tracker["verdict"]
        assert row["lost"] == json.dumps(tracker["lost"])
        assert int(row["frames.delivered"]) == metrics["frames"]["delivered"]
        if tracker["nees_band"]:
            assert [float(row["nees_band.low"]), float(row["nees_band.high"])] == tracker["nees_band"]
    assert [row["target.path"] for row in rows] == ["s1"] * 4 + ["s2"]
    assert json.loads(rows[2]["faults"])[0]["kind"] == "restart"
    assert rows[0]["faults"] == ""


# --- the recording ----------------------------------------------------------------------------------------------------


def test_the_recording_has_both_runs_on_one_timeline(trackfield: Call, tmp_path: Path, home: Path) -> None:
    said = trackfield("compare", home / "a", home / "out", "--rrd", "both.rrd")
    assert "recording: both.rrd\n" in said.err
    file = tmp_path / "both.rrd"
    assert verify(file).returncode == 0
    assert {f"/plots/error/spcpf/{name}" for name in ("a", "out")} <= entities(file)
    errors = dict(read(file, "/plots/error/spcpf/out", "Scalars:scalars"))
    table = pq.read_table(home / "out" / "tracks.parquet").to_pylist()
    known = {row["t_s"]: np.hypot(row["x"] - row["true_x"], row["y"] - row["true_y"])
             for row in table if row["tracker"] == "spcpf" and row["x"] is not None}  # fmt: skip
    assert {t: value[0] for t, value in errors.items() if t is not None and np.isfinite(value[0])} == pytest.approx(
        known
    )
    assert np.isnan(errors[6.0][0])  # the line breaks in the outage
    assert [len(value) for t, value in read(file, "/field/spcpf/out/track", "LineStrips2D:strips") if t == 6.0] == [0]


def test_a_recording_is_a_timeline_that_view_takes(trackfield: Call, tmp_path: Path, home: Path) -> None:
    assert trackfield("compare", home / "a", home / "out", "--rrd", "both.rrd").code == 0
    from launcher.timeline.recording import timeline_of

    assert timeline_of(tmp_path / "both.rrd") == tmp_path / "both.rrd"
    assert timeline_of(home / "a") == home / "a" / "run.rrd"


# --- what is refused --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["a", "a"], ["RUN: a is named twice", "different runs"]),
        (["a"], ["RUN: 1 given"]),
        (["a", "out", "--html", "no/page.html"], ["no/page.html: --html: cannot be written", "writable folder"]),
        (["a", "out", "--csv", "a"], ["a: --csv: is a file of a run"]),
        (["a", "out", "--rrd", "a/run.rrd"], ["a/run.rrd: --rrd: is a file of a run", "outside the run folders"]),
        (["a", "out", "--html", "x", "--csv", "./x"], ["x: --csv: --html names the same file", "another file"]),
    ],
)
def test_what_cannot_be_written_is_refused_before_anything_is(
    trackfield: Call, monkeypatch: pytest.MonkeyPatch, home: Path, arguments: list[str], parts: list[str]
) -> None:
    monkeypatch.chdir(home)
    before = {file: file.stat().st_mtime_ns for file in home.rglob("*")}
    said = trackfield("compare", *arguments)
    assert (said.code, said.out) == (2, "")
    assert all(part in said.err for part in parts)
    assert {file: file.stat().st_mtime_ns for file in home.rglob("*")} == before


def test_a_file_that_exists_is_overwritten(trackfield: Call, tmp_path: Path, home: Path) -> None:
    (tmp_path / "page.html").write_text("of another comparison")
    read, _ = page(trackfield, tmp_path, home / "a", home / "out")
    assert "of another comparison" not in read.text


# --- from Python ------------------------------------------------------------------------------------------------------


def test_a_comparison_shows_itself(home: Path) -> None:
    comparison = tf.compare([home / "a", home / "out"])
    whole, piece = Reader(comparison.to_html()), Reader(comparison._repr_html_())
    assert "Error over time" in whole.text
    assert "imm-ukf verdict tracked" in piece.text
    assert [tag for tag, _ in piece.tags if tag in ("html", "body", "img")] == []
    error = read_runs([home / "a", home / "out"]).metrics[0]["trackers"]["spcpf"]["rmse"]["position"]
    assert f"{error:.2f}" in piece.text
    assert f"{error:.2f}" in repr(comparison)
    assert "a lower figure may be chance" in repr(comparison)
    with pytest.raises(tf.ScenarioError, match=r"runs: .* is named twice"):
        tf.compare([home / "a", home / "a"])


# --- in a browser -----------------------------------------------------------------------------------------------------


@with_browser
@pytest.mark.parametrize("width", [1280, 500])
@pytest.mark.rendered
def test_the_page_opens_offline_on_a_screen_of_any_width(
    trackfield: Call, tmp_path: Path, home: Path, width: int
) -> None:
    page(trackfield, tmp_path, home / "a", home / "out")
    file, asked, complaints = (tmp_path / "page.html").as_uri(), list[str](), list[str]()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        try:
            shown = browser.new_context(offline=True, viewport={"width": width, "height": 900}).new_page()
            shown.on("request", lambda request: asked.append(request.url))
            shown.on("console", lambda message: complaints.append(message.text))
            shown.goto(file)
            sizes = shown.eval_on_selector_all("img", "all => all.map(one => [one.naturalWidth, one.clientWidth])")
            wide = shown.evaluate("document.documentElement.scrollWidth")
        finally:
            browser.close()
    assert [url for url in asked if not url.startswith("data:")] == [file]
    assert complaints == []
    assert all(natural > 1000 and 300 < drawn <= width for natural, drawn in sizes)
    assert wide <= width
