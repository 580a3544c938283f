"""``trackfield study``: what a person gets to see, and what is left in the folder."""

from __future__ import annotations

import csv
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np
import psutil
import pyarrow.parquet as pq
import pytest
from matplotlib.container import ErrorbarContainer
from scipy import stats

import trackfield as tf
from launcher.study.axes import Axis, parse_vary
from launcher.study.figures import FIGURES
from launcher.study.intervals import Estimate, mean_of, share_of
from launcher.study.pictures.effects import axis_picture, lines
from launcher.study.pictures.pareto import front_of, pareto_picture
from launcher.study.summary import Row, Summary
from tests.command_line import Call, trackfield
from tests.reporting import Reader
from tests.running import PATIENCE_S, killed_on_failure, until

__all__ = ["trackfield"]

FIELD = ("zhai-spcpf", "--set", "target.steps=6", "--set", "link.loss=0.2")
VARIED = ("--vary", "field.spacing_m=50,75", "--vary", "link.model=ideal,fixed")
SPACINGS, MODELS, TRACKERS = (50, 75), ("ideal", "fixed"), ("imm-ukf", "spcpf")


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "launcher.cli", *arguments]


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str, str]:
    """The folder of a study, and what was said on stdout and stderr."""
    home = tmp_path_factory.mktemp("study")
    asked = command("study", *FIELD, "--seeds", "3", *VARIED, "--jobs", "1", "--out", "s")
    wide = {**os.environ, "COLUMNS": "180"}
    done = subprocess.run(asked, cwd=home, capture_output=True, text=True, timeout=200, check=False, env=wide)
    assert done.returncode == 0, done.stderr
    return home / "s", done.stdout, done.stderr


def rows(file: Path) -> list[dict[str, str]]:
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


# --- the tables -------------------------------------------------------------------------------------------------------


def test_the_terminal_has_a_row_for_each_combination_and_tracker(study: tuple[Path, str, str]) -> None:
    folder, out, err = study
    for line in rows(folder / "summary.csv"):
        mean, low, high = (float(line[f"rmse.position{end}"]) for end in ("", ".low", ".high"))
        found = re.search(
            rf"^ *{line['field.spacing_m']} +{line['link.model']} +{line['tracker']} +(\d+) %.* "
            r"([\d.]+) \(([\d.]+)–([\d.]+)\)",
            out,
            re.MULTILINE,
        )
        assert found, out
        share, *said = map(float, found.groups())
        assert share == round(100 * int(line["tracked"]) / 3)
        assert said == pytest.approx([mean, low, high], rel=0.01, abs=0.006)
    assert "95 % confidence intervals: Student's t for means, Wilson's for shares" in " ".join(out.split())
    assert "4 combinations (field.spacing_m = 50, 75; link.model = ideal, fixed), seeds 1 to 3: 12 runs" in err
    assert "next: open s/study.html" in err


@pytest.mark.parametrize("columns", [80, 120])
def test_a_narrow_terminal_gets_the_columns_that_fit(
    study: tuple[Path, str, str], columns: int, monkeypatch: pytest.MonkeyPatch, trackfield: Call
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    again = ("study", *FIELD, "--seeds", 3, *VARIED, "--out", study[0])
    out = trackfield(*again).out
    lines = out.splitlines()
    assert max(map(len, lines)) <= columns
    assert sum("imm-ukf" in line and "%" in line and "–" in line for line in lines) == 4
    assert ("energy" in out, "median" in out) == (True, False)
    assert "study.html has more columns" in " ".join(out.split())


def test_each_run_is_that_of_the_command_line(study: tuple[Path, str, str], trackfield: Call) -> None:
    folder, *_ = study
    table = rows(folder / "study.csv")
    assert [(row["field.spacing_m"], row["link.model"], row["seed"], row["tracker"]) for row in table] == [
        (str(m), model, str(seed), name)
        for m in SPACINGS
        for model in MODELS
        for seed in (1, 2, 3)
        for name in TRACKERS
    ]
    asked = ("run", *FIELD, "--set", "field.spacing_m=75", "--link", "fixed", "--virtual", "--seed", 2, "--out", "r")
    assert trackfield(*asked).code == 0
    metrics = json.loads(Path("r/metrics.json").read_text())
    (row,) = [r for r in table if (r["field.spacing_m"], r["link.model"], r["seed"], r["tracker"]) == (
        "75", "fixed", "2", "spcpf")]  # fmt: skip
    tracker = metrics["trackers"]["spcpf"]
    for key in ("verdict", "steps_expected", "share_within", "longest_blackout_s"):
        assert row[key] == str(tracker[key]).removesuffix(".0")
    assert float(row["rmse.position"]) == tracker["rmse"]["position"]
    assert float(row["energy_j.total"]) == metrics["energy_j"]["total"]
    assert int(row["frames.lost.radio"]) == metrics["frames"]["lost"]["radio"] > 0
    assert float(row["latency_ms.to_track.p95"]) == metrics["latency_ms"]["to_track"]["p95"]


def test_the_summary_has_means_over_the_runs(study: tuple[Path, str, str]) -> None:
    folder, *_ = study
    runs = pq.read_table(folder / "study.parquet").to_pylist()
    for line in rows(folder / "summary.csv"):
        own = [
            run
            for run in runs
            if all(str(run[key]) == line[key] for key in ("field.spacing_m", "link.model", "tracker"))
        ]
        assert len(own) == int(line["runs"]) == 3
        errors = [run["rmse.position"] for run in own if run["rmse.position"] is not None]
        low, high = stats.t.interval(0.95, len(errors) - 1, fmean(errors), stats.sem(errors))
        assert float(line["rmse.position"]) == pytest.approx(fmean(errors))
        assert float(line["rmse.position.low"]) == pytest.approx(max(low, 0.0))
        assert float(line["rmse.position.high"]) == pytest.approx(high)
        assert int(line["tracked"]) == sum(run["verdict"] == "tracked" for run in own)
        losses = [sum(value for key, value in run.items() if key.startswith("frames.lost.")) for run in own]
        assert float(line["frames.lost"]) == pytest.approx(fmean(losses))


def test_the_tracks_say_whose_they_are(study: tuple[Path, str, str]) -> None:
    table = pq.read_table(study[0] / "tracks.parquet")
    assert table.column_names[:3] == ["field.spacing_m", "link.model", "seed"]
    found = {tuple(row.values()) for row in table.select(table.column_names[:3]).to_pylist()}
    assert found == {(m, model, seed) for m in SPACINGS for model in MODELS for seed in (1, 2, 3)}


def test_python_gets_the_same_study(study: tuple[Path, str, str]) -> None:
    scenario = tf.Scenario.load("zhai-spcpf", {"target.steps": 6, "link.loss": 0.2})
    same = tf.study(scenario, range(1, 4), {"field.spacing_m": SPACINGS, "link.model": MODELS}, n_jobs=1)
    assert same.table.equals(pq.read_table(study[0] / "study.parquet"))
    assert repr(same) == "Study(zhai-spcpf, 4 combinations, 12 runs)"


# --- the page and its pictures ----------------------------------------------------------------------------------------


def test_the_page_has_everything_and_opens_offline(study: tuple[Path, str, str]) -> None:
    folder, *_ = study
    page = Reader((folder / "study.html").read_text())
    images = [attrs["src"] or "" for tag, attrs in page.tags if tag == "img"]
    assert len(images) == 3  # spacing, link and the front
    assert all(source.startswith("data:image/png;base64,") for source in images)
    links = [attrs["href"] or "" for tag, attrs in page.tags if tag == "a"]
    assert all((folder / name).exists() for name in links)
    assert {file.name for file in (folder / "plots").iterdir()} == {
        "field.spacing_m.png", "link.model.png", "pareto.png"}  # fmt: skip
    assert f"trackfield study {' '.join(FIELD)} --seeds 3" in page.text
    assert "less energy and less RMSE is better (energy_j.total, rmse.position)" in page.text
    mean = float(rows(folder / "summary.csv")[0]["rmse.position"])
    assert f"{mean:.2f}" in page.text


def test_the_page_names_a_run_of_each_combination_to_look_at(
    study: tuple[Path, str, str], trackfield: Call, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, *_ = study
    page = Reader((folder / "study.html").read_text())
    said = re.findall(r"field.spacing_m=(\d+), link.model=(\w+) trackfield (run \S+ --virtual --seed \d)", page.text)
    assert [found[:2] for found in said] == [(str(m), model) for m in SPACINGS for model in MODELS]
    monkeypatch.chdir(folder.parent)
    metrics = json.loads(trackfield(*said[3][2].split(), "--out", "look", "--json").out)
    runs = pq.read_table(folder / "study.parquet").to_pylist()
    own = [r for r in runs if (r["field.spacing_m"], r["link.model"], r["tracker"]) == (75, "fixed", "imm-ukf")]
    assert metrics["trackers"]["imm-ukf"]["rmse"]["position"] == np.median([r["rmse.position"] for r in own])


def row(values: Mapping[str, Any], tracker: str = "ekf", lost: int = 0, **figures: float | None) -> Row:
    """Of ten runs; figures by their keys with __ for a point, each with an interval of 1 either way."""
    given = {key.replace("__", "."): value for key, value in figures.items()}
    means = {
        key: None if (value := given.get(key)) is None else Estimate(value, value - 1, value + 1, 10) for key in FIGURES
    }
    return Row(values, tracker, 10, {"tracked": 10 - lost, "tracked with gaps": 0, "lost": lost}, means)


def summary(axes: tuple[Axis, ...], *found: Row) -> Summary:
    return Summary("made", axes, tuple(range(1, 11)), found)


def bars(summary: Summary, axis: Axis, title: str) -> list[ErrorbarContainer]:
    """The lines of a panel of an axis's picture."""
    (panel,) = [axes for axes in axis_picture(summary, axis).axes if axes.get_title(loc="left") == title]
    return [drawn for drawn in panel.containers if isinstance(drawn, ErrorbarContainer)]


def test_numbers_are_a_scale_and_intervals_are_bars() -> None:
    axis = Axis("field.spacing_m", (50, 75, 200))
    made = summary((axis,), *(row({axis.key: m}, rmse__position=m / 10) for m in axis.values))
    (line,) = bars(made, axis, "RMSE [m]")
    assert line.lines[0].get_xydata() == pytest.approx(np.array([[50, 5.0], [75, 7.5], [200, 20.0]]))
    (ends,) = line.lines[2]
    assert [segment[:, 1].tolist() for segment in ends.get_segments()] == [[4, 6], [6.5, 8.5], [19, 21]]
    assert {axes.get_xlabel() for axes in axis_picture(made, axis).axes} == {"field.spacing_m"}


def test_words_are_categories_and_the_other_axes_lines() -> None:
    radios, sizes = Axis("link.radio", ("mica2", "lora868")), Axis("energy.battery_j", (10, 20))
    made = summary(
        (radios, sizes),
        *(row({radios.key: r, sizes.key: j}, rmse__position=j) for r in radios.values for j in sizes.values),
    )
    figure = axis_picture(made, radios)
    assert [label.get_text() for label in figure.axes[0].get_xticklabels()] == ["mica2", "lora868"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["energy.battery_j=10", "energy.battery_j=20"]
    drawn = bars(made, radios, "RMSE [m]")
    assert [line.lines[0].get_ydata().tolist() for line in drawn] == [[10, 10], [20, 20]]
    assert len({round(x, 6) for line in drawn for x in line.lines[0].get_xdata()}) == 4  # beside each other


def test_what_no_run_has_is_not_drawn() -> None:
    axis = Axis("a", (1, 2))
    made = summary((axis,), row({"a": 1}, rmse__position=1.0), row({"a": 2}, rmse__position=None))
    (line,) = bars(made, axis, "RMSE [m]")
    assert np.isnan(line.lines[0].get_ydata()[1])
    assert not any("battery" in axes.get_title(loc="left") for axes in axis_picture(made, axis).axes)


def test_an_odd_number_of_panels_leaves_a_place_empty() -> None:
    axis, keys = Axis("a", (1, 2)), ("rmse.position", "energy_j.total", "frames.lost", "longest_blackout_s")
    made = summary((axis,), *(row({"a": a}, **{key.replace(".", "__"): a for key in keys}) for a in axis.values))
    panels = axis_picture(made, axis).axes
    assert len(panels) == 5
    assert [axes.get_xlabel() for axes in panels] == ["", "", "", "a", "a"]
    shown = [any(tick.label1.get_visible() for tick in axes.xaxis.get_major_ticks()) for axes in panels]
    assert shown == [False, False, False, True, True]


def test_too_many_lines_are_held_at_a_value_which_is_said() -> None:
    axes = tuple(Axis(name, (1, 2, 3)) for name in "abc")
    made = summary(
        axes,
        *(row({"a": a, "b": b, "c": c}, rmse__position=a) for a in (1, 2, 3) for b in (1, 2, 3) for c in (1, 2, 3)),
    )
    drawn, held = lines(made, axes[0])
    assert ([line.name for line in drawn], held) == (["b=1", "b=2", "b=3"], {"c": 1})
    assert axis_picture(made, axes[0]).legends[0].get_title().get_text() == "at c=1"


def test_the_front_has_what_no_other_dominates() -> None:
    """Error and lifetime: less of one, more of the other; a combination that is mostly lost is never on it."""
    axis = Axis("a", (1, 2, 3, 4))
    errors, lives = (1.0, 2.0, 3.0, 0.5), (10.0, 30.0, 20.0, 50.0)
    found = [
        row({"a": a}, lost=5 if a == 4 else 0, rmse__position=error, lifetime_s__first_death=life)
        for a, error, life in zip(axis.values, errors, lives, strict=True)
    ]
    front = front_of(summary((axis,), *found), "rmse.position", "lifetime_s.first_death")
    assert ([front.rows[place].values["a"] for place in front.best], front.out) == ([1, 2], (3,))
    axes = pareto_picture(front).axes[0]
    assert axes.get_ylabel() == "first battery empty [s]   (more is better)"
    assert {text.get_text() for text in axes.texts} == {"1", "2", "3", "4"}


def test_of_two_that_cost_the_same_the_worse_is_dominated(study: tuple[Path, str, str]) -> None:
    """As trackers of one run, which have the same energy."""
    found = [row({}, name, energy_j__total=7.0, rmse__position=error) for name, error in (("ekf", 2.0), ("ukf", 1.0))]
    front = front_of(summary((), *found), "energy_j.total", "rmse.position")
    assert [front.rows[place].tracker for place in front.best] == ["ukf"]
    said = "another is no worse in either and better in one"
    assert f"dominated: {said}" in [text.get_text() for text in pareto_picture(front).legends[0].get_texts()]
    assert f"is not on the front if {said}, or if it lost half" in Reader((study[0] / "study.html").read_text()).text


def test_figures_that_no_run_has_make_no_front_and_that_is_said(trackfield: Call) -> None:
    asked = ("study", "zhai-spcpf", "--seeds", 1, "--tracker", "ekf", "--set", "target.steps=3", "--out", "s")
    said = trackfield(*asked, "--pareto", "frames.sent,lifetime_s.first_death")
    assert said.code == 0
    missing = "no run has both figures, frames.sent and lifetime_s.first_death"
    assert f"note: there is no Pareto front: {missing}" in " ".join(said.err.split())
    assert f"There is no front: {missing}." in Reader(Path("s/study.html").read_text()).text
    assert not Path("s/plots/pareto.png").exists()


# --- intervals --------------------------------------------------------------------------------------------------------


def test_intervals_are_those_of_the_books() -> None:
    """Student's t with 3 degrees of freedom (3.1824); Wilson's of 81 in 263 (Newcombe 1998, table I)."""
    found = mean_of([9.0, 11.0, 9.0, 11.0])  # their sd is sqrt(4 / 3)
    half = 3.1824 * np.sqrt(4 / 3) / 2
    assert found == Estimate(10.0, pytest.approx(10 - half, abs=1e-4), pytest.approx(10 + half, abs=1e-4), 4)
    share = share_of(81, 263)
    assert (share.low, share.high) == (pytest.approx(0.2553, abs=1e-4), pytest.approx(0.3662, abs=1e-4))
    assert (mean_of([0.0, 0.0, 0.1]) or share).low == 0.0


def test_few_seeds_have_no_intervals_and_the_table_says_so(trackfield: Call) -> None:
    said = trackfield("study", "zhai-spcpf", "--seeds", 2, "--set", "target.steps=3", "--tracker", "ekf", "--out", "s")
    assert said.code == 0
    assert "Means over 2 runs: too few for intervals, which need 3." in said.out
    assert "(" not in said.out
    assert "Too few seeds for intervals." in Reader(Path("s/study.html").read_text()).text
    assert Path("s/median/report.html").exists()
    assert rows(Path("s/summary.csv"))[0]["rmse.position.low"] == ""


# --- going on ---------------------------------------------------------------------------------------------------------


SHORT = ("zhai-spcpf", "--tracker", "ekf", "--vary", "sensor.threshold=0.74,0.75", "--out", "s")


def test_what_is_there_is_not_run_again(trackfield: Call) -> None:
    assert trackfield("study", *SHORT, "--set", "target.steps=3", "--seeds", 1).code == 0
    before = {file: file.stat().st_mtime_ns for file in Path("s/results").rglob("*.parquet")}
    said = trackfield("study", *SHORT, "--set", "target.steps=3", "--seeds", 2)
    assert "2 of 4 runs exist already" in said.err
    assert "note: the seeds were 1, and are now 1, 2" in said.err
    after = {file: file.stat().st_mtime_ns for file in Path("s/results").rglob("*.parquet")}
    assert (len(before), len(after)) == (2, 4)
    assert {file: after[file] for file in before} == before

    said = trackfield("study", *SHORT, "--set", "target.steps=4", "--seeds", 2)
    assert "the scenario differs from that of the study in this folder: target.steps was 3 and is 4" in said.err
    assert "from before" not in said.err


@pytest.mark.parametrize("mark", ["notes.txt", ".trackfield-reproduce"])
def test_a_folder_that_is_no_study_stays_as_it_is(trackfield: Call, tmp_path: Path, mark: str) -> None:
    mine = {name: tmp_path / "s" / name for name in (f"results/{mark}", "plots/a.png", "median/b", "manifest.json")}
    for name, file in mine.items():
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(name)
    said = trackfield("study", *SHORT, "--set", "target.steps=3", "--seeds", 1)
    assert said.code == 2
    assert "s: --out: the folder is not empty; expected an empty or new one, or that of an earlier" in said.err
    assert {file for file in (tmp_path / "s").rglob("*") if file.is_file()} == set(mine.values())
    assert all(file.read_text() == name for name, file in mine.items())


def test_a_study_of_a_track_goes_by_what_is_in_its_file(trackfield: Call) -> None:
    """Wherever the file lies; the folder's own scenario goes on with the study, too."""
    Path("a.csv").write_text("t_s,x,y\n0,0,0\n20,200,0\n")
    asked = ("--seeds", 1, "--vary", "field.spacing_m=50,60", "--tracker", "ekf", "--out", "s")
    assert trackfield("study", "bus", "--target", "a.csv", *asked).code == 0
    Path("a.csv").rename("b.csv")
    assert "2 of 2 runs exist already" in trackfield("study", "bus", "--target", "b.csv", *asked).err
    Path("b.csv").write_text("t_s,x,y\n0,0,0\n20,200,20\n")
    said = trackfield("study", "bus", "--target", "b.csv", *asked)
    assert said.code == 0
    assert "from before" not in said.err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_a_terminal_that_ends_a_study_keeps_what_is_done(number: int, tmp_path: Path, trackfield: Call) -> None:
    """Ctrl-C, or because it is closed: both reach the workers, too."""
    asked = (
        "study",
        "zhai-spcpf",
        "--tracker",
        "ekf",
        "--set",
        "target.steps=3",
        "--vary",
        "sensor.threshold=0.74,0.75",
    )
    with (
        subprocess.Popen(
            command(*asked, "--seeds", "2000"), cwd=tmp_path, stderr=subprocess.PIPE, text=True, process_group=0
        ) as running,
        killed_on_failure(running),
    ):
        until(lambda: len(list(tmp_path.rglob("0*.parquet"))) >= 3)
        os.killpg(running.pid, number)
        _, err = running.communicate(timeout=PATIENCE_S)
    done = len(list(tmp_path.rglob("0*.parquet")))
    assert running.returncode == 128 + number
    (said,) = re.findall(
        r"interrupted: (\d+) of 4000 runs are done and kept in (\S+); the same command runs the others", err
    )
    assert said[0] == str(done)
    assert 3 <= done < 4000
    assert "Traceback" not in err
    first = len(list(tmp_path.rglob("00001.parquet")))  # workers need not end in the order in which they began
    assert first > 0
    again = trackfield(*asked, "--seeds", 1)  # into the same folder, as none was named
    assert again.code == 0
    assert f"{first} of 2 runs exist already" in again.err
    assert (tmp_path / said[1] / "study.html").exists()


def test_a_worker_that_is_killed_ends_a_study_with_one_message(tmp_path: Path) -> None:
    asked = command("study", "zhai-spcpf", "--set", "target.steps=40", "--seeds", "2000", "--jobs", "2")
    with subprocess.Popen(asked, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as running:
        until(lambda: len(list(tmp_path.rglob("0*.parquet"))) >= 3)
        workers = [one for one in psutil.Process(running.pid).children() if "loky" in " ".join(one.cmdline())]
        trackers = [one for one in psutil.Process(running.pid).children() if "tracker" in " ".join(one.cmdline())]
        told = [one.environ().get("PYTHONWARNINGS", "") for one in trackers]
        max(workers, key=lambda one: one.cpu_times().user).kill()
        _, err = running.communicate(timeout=PATIENCE_S)
    assert running.returncode == 1
    assert told and all(one.endswith("ignore:resource_tracker") for one in told)
    assert err.splitlines()[-1].startswith("trackfield: a worker process was killed")
    assert "Traceback" not in err


def interrupt(*_: object) -> None:
    """Do what Ctrl-C does in Python; where a test runner ignores the signal itself, that would do nothing."""
    raise KeyboardInterrupt


def test_ctrl_c_after_the_last_run_says_what_is_left(trackfield: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = ("study", *SHORT, "--set", "target.steps=3", "--seeds", 1)
    with monkeypatch.context() as once:
        once.setattr("launcher.study.page.draw", interrupt)
        said = trackfield(*asked)
    assert said.code == 130
    done = "interrupted: all 2 runs are done and kept in s; the same command writes the page"
    assert done in " ".join(said.err.split())
    assert trackfield(*asked).code == 0
    assert Path("s/study.html").exists()


def test_the_median_run_of_another_study_does_not_stay(trackfield: Call) -> None:
    asked = ("study", "zhai-spcpf", "--tracker", "ekf", "--set", "target.steps=3", "--seeds", 1, "--out", "s")
    assert trackfield(*asked).code == 0
    assert Path("s/median").exists()
    assert trackfield(*asked, "--vary", "sensor.threshold=0.74,0.75").code == 0
    assert not Path("s/median").exists()


# --- what is given on the line ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("field.spacing_m=50,75,100", (50, 75, 100)),
        ("link.radio=mica2, lora868", ("mica2", "lora868")),
        ("link.radio='mica2','lora868'", ("mica2", "lora868")),
        ("sensor.threshold=[.5,.7]", (0.5, 0.7)),
        ("sensor.threshold=[0.5,0.7]", (0.5, 0.7)),
        ("fusion.trackers=['ukf'],['ekf','ukf']", (["ukf"], ["ekf", "ukf"])),
        ("clock.sync=true,false", (True, False)),
    ],
)
def test_values_of_every_kind(text: str, values: tuple[Any, ...]) -> None:
    assert parse_vary([text]) == {text.partition("=")[0]: values}


def test_trackers_one_at_a_time_and_lists_of_them(trackfield: Call) -> None:
    asked = ("study", "zhai-spcpf", "--seeds", 1, "--set", "target.steps=3")
    assert trackfield(*asked, "--vary", "tracker=ukf,ekf", "--out", "a").code == 0
    assert [row["tracker"] for row in rows(Path("a/study.csv"))] == ["ukf", "ekf"]
    assert trackfield(*asked, "--vary", "fusion.trackers=['ukf'],['ekf','ukf']", "--out", "b").code == 0
    found = [(row["fusion.trackers"], row["tracker"]) for row in rows(Path("b/study.csv"))]
    assert found == [('["ukf"]', "ukf"), ('["ekf", "ukf"]', "ekf"), ('["ekf", "ukf"]', "ukf")]


def test_times_are_values(trackfield: Call) -> None:
    asked = ("study", "bus", "--seeds", 1, "--tracker", "ekf", "--set", "target.steps=3", "--out", "s")
    said = trackfield(*asked, "--vary", "target.from=08:00:00,08:01:00")
    assert said.code == 0, said.err
    assert [row["target.from"] for row in rows(Path("s/study.csv"))] == ["08:00:00", "08:01:00"]
    assert json.loads(Path("s/manifest.json").read_text())["study"]["vary"] == {"target.from": ["08:00:00", "08:01:00"]}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--vary", "field.spacing_mm=1,2"), "field.spacing_mm: unknown; did you mean spacing_m?"),
        (("--vary", "field.spacing_m=50,-1"), "field.spacing_m: is -1; expected a number from 0.001 to"),
        (("--vary", "field.spacing_m=50"), "field.spacing_m: has one value, 50; expected two values or more; --set"),
        (("--vary", "field.spacing_m=50,50.0"), "field.spacing_m: 50 is given twice; expected each value once"),
        (("--vary", "field.spacing_m"), "--vary: 'field.spacing_m' varies nothing; expected KEY=VALUE,VALUE"),
        (("--vary", "a=1,,x"), "--vary: a: an empty value in '1,,x'"),
        (("--vary", "link.model=a,b", "--vary", "link.model=c,d"), "--vary: link.model: is varied twice"),
        (("--vary", "link.model=ideal,fixed", "--link", "ideal"), "is varied, and set by another option (link.model)"),
        (("--vary", "tracker=ukf,ekf", "--tracker", "ekf"), "is varied, and set by another option (fusion.trackers)"),
        (("--vary", "tracker=ukf,ukff"), "unknown tracker 'ukff'; did you mean ukf?"),
        (("--vary", "seed=1,2"), "seed: is not varied: a study has seeds of its own"),
        (("--set", "seed=3"), "--set: seed: has no effect beside --seeds"),
        (("--seeds", "many"), "--seeds: is 'many'; expected how many, like 20"),
        (("--seeds", "0"), "--seeds: '0' gives no seeds"),
        (("--seeds", "10000000000"), "seeds: there are too many; expected 1,000,000 or fewer"),
        (("--pareto", "energy,rmse.position"), "--pareto: there is no figure 'energy'"),
        (("--pareto", "rmse.position"), "--pareto: is 'rmse.position'; expected two figures"),
        (("--vary", "link.loss=0.1,0.2", "--vary", "link.radio=mica2,lora868"), "link.loss: belongs to model fixed"),
        (("--jobs", "0"), "Invalid value for '--jobs'"),
    ],
)
def test_bad_input_is_one_message_and_nothing_runs(trackfield: Call, arguments: tuple[str, ...], said: str) -> None:
    found = trackfield("study", "zhai-spcpf", *arguments)
    assert found.code == 2
    assert said in found.err
    assert found.err.count("trackfield:") == 1
    assert not Path("runs").exists()


def test_what_is_likely_to_go_wrong_is_said_before(trackfield: Call) -> None:
    asked = ("study", "zhai-spcpf", "--seeds", 1, "--set", "target.steps=3", "--tracker", "ekf", "--out", "s")
    said = trackfield(*asked, "--vary", "link.radio=mica2,wifi11b")
    assert said.code == 0
    assert re.search(r"warning: with link.radio=mica2: less than 50 ?% ", said.err)
    assert "with link.radio=wifi11b" not in said.err


def test_the_documented_figures_are_those_there_are() -> None:
    text = (Path(__file__).parents[1] / "docs" / "study.md").read_text()
    table = text.partition("| figure | unit | meaning |")[2].partition("\n## ")[0]
    assert re.findall(r"^\| `(\S+)` \|", table, re.MULTILINE) == list(FIGURES)
    more = {key for key in FIGURES if re.search(rf"`{re.escape(key)}` .*more is better", table)}
    assert more == {key for key, figure in FIGURES.items() if figure.better == "more"}
