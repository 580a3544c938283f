"""The Python API: runs, studies, comparisons, and what is said of bad input."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, get_args, get_origin

import joblib
import numpy as np
import psutil
import pyarrow.parquet as pq
import pytest
from pydantic import BaseModel

import trackfield as tf
from launcher import api
from launcher.plan.prepare import checked
from launcher.record.figures.measures import RunFigures
from launcher.report.cells import number
from launcher.run import Outcome
from launcher.study.results import study_run
from tests.command_line import Call, trackfield
from tests.interrupting import interrupt_at
from tests.reporting import Reader
from tests.test_metrics import KEYS, expanded, paths

__all__ = ["trackfield"]

SMALL = tf.Scenario.load("spcpf").set("field.nodes", 9).set("target.steps", 10)


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports have tests of their own, and take longer than all else here."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("launcher.run._report", lambda *_: "")


def file_of(result: tf.Result) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((result.path / "metrics.json").read_text())
    return found


def repeatable(metrics: RunFigures) -> dict[str, Any]:
    """All figures but those of this machine."""
    return metrics.model_dump(exclude={"wall_s", "cpu_s"})


# --- figures with types -----------------------------------------------------------------------------------------------


def keys_of(model: type[BaseModel], before: str = "") -> Iterator[str]:
    """The keys of metrics.json for which there is a field; those of a mapping as ``<>``."""
    for name, field in model.model_fields.items():
        inner = [one for one in (field.annotation, *get_args(field.annotation)) if isinstance(one, type)]
        part = next((one for one in inner if issubclass(one, BaseModel)), None)
        if part is None or name in ("died", "stopped"):
            yield f"{before}{name}"
        else:
            several = get_origin(field.annotation) is Mapping
            yield from keys_of(part, f"{before}{name}.{'<>.' if several else ''}")


def test_there_is_a_field_for_every_key() -> None:
    named = {
        "attempts",
        "frames.refused",
        "clusters.members",
        "energy_j.by_role",
        "passes.trackers.<>.refused",
        "camera.outcomes",
    }
    documented = {
        re.sub(r"<\w+>", "<>", key) for key in expanded(KEYS) if not key.startswith("energy_j.by_accounting.")
    } - {"trackers.<>.sources.<>", "attempts.<>.<>", *(f"{key}.<>" for key in named)}
    found = {re.sub(r"(\.views\.<>)\..*", r"\1", key) for key in keys_of(RunFigures)}  # the same again in each view
    assert found - {"trackers.<>.sources"} == documented | named | {"energy_j.by_accounting"}


def test_the_figures_are_those_of_the_file() -> None:
    result = tf.run(SMALL)
    assert result.metrics.trackers["spcpf"].rmse.position == file_of(result)["trackers"]["spcpf"]["rmse"]["position"]
    assert result.metrics.driver == "virtual"
    assert result.metrics.frames.by_kind["doa"].sent == result.metrics.frames.sent > 0
    typed, written = result.metrics.model_dump(mode="json"), file_of(result)
    for key in paths(written):
        if "<" not in key:
            a, b = typed, written
            for part in key.split("."):
                a, b = a[part], b[part]
            assert a == b, key


def test_figures_that_are_missing_are_named() -> None:
    result = tf.run(SMALL)
    metrics = file_of(result)
    del metrics["frames"]["sent"]
    (result.path / "metrics.json").write_text(json.dumps(metrics))
    with pytest.raises(tf.ScenarioError, match=r"metrics\.json: frames\.sent: is missing; expected the figures"):
        _ = tf.open(result.path).metrics


# --- runs -------------------------------------------------------------------------------------------------------------


def test_a_run_is_that_of_the_command_line(trackfield: Call, tmp_path: Path) -> None:
    result = tf.run(SMALL.set("link.model", "gilbert_elliott"), seed=3, out=tmp_path / "a")
    small = ("--set", "field.nodes=9", "--set", "target.steps=10", "--link", "gilbert_elliott")
    assert trackfield("run", "spcpf", "--virtual", "--seed", 3, *small, "--out", "b").code == 0
    other = tf.open("b")
    assert result.path == tmp_path / "a"
    assert repeatable(result.metrics) == repeatable(other.metrics)
    assert result.tracks == other.tracks
    assert result.messages == other.messages
    assert result.messages.num_rows == result.metrics.frames.expected


def test_runs_below_a_folder_get_names_of_their_own(tmp_path: Path) -> None:
    one, other = (tf.run(SMALL, seed=seed, out=f"{tmp_path}/") for seed in (1, 2))
    assert [run.path.parent for run in (one, other)] == [tmp_path] * 2
    assert (one.path.name[:13], other.path.name[:13]) == ("zhai-spcpf-1-", "zhai-spcpf-2-")


def test_a_folder_tells_how_to_repeat_its_run() -> None:
    result = tf.run(SMALL, seed=5)
    assert result.path.parent == Path("runs")
    assert result.path.name.startswith("zhai-spcpf-5-")
    command = json.loads((result.path / "manifest.json").read_text())["command"]
    assert command == ["trackfield", "run", str(result.path / "scenario.toml"), "--virtual"]
    assert repeatable(tf.run(tf.Scenario.load(result.path / "scenario.toml")).metrics) == repeatable(result.metrics)


SCRIPT = """
import threading
import trackfield as tf
from launcher import run

run._report = lambda *_: ""  # to draw it takes longer than all else
scenario = tf.Scenario.load("spcpf").set("field.nodes", 9).set("target.steps", 3)
threads = [
    threading.Thread(target=lambda n=n: print(tf.run(scenario, driver="processes", speed=1, out=f"r{n}").path))
    for n in range(2)
]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
"""


def test_processes_need_no_main_module_and_may_start_in_threads(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-"], input=SCRIPT, text=True, capture_output=True, timeout=150, cwd=tmp_path, check=False
    )
    assert (done.returncode, done.stderr, sorted(done.stdout.split())) == (0, "", ["r0", "r1"])
    result = tf.open("r0")
    assert result.metrics.driver == "processes"
    assert result.metrics.processes.died == ()
    assert (result.metrics.timing.speed, result.metrics.frames.host_lost) == (1.0, 0)


def test_a_failed_run_says_who_died_and_where_its_log_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    died = {"processes": {"died": [{"id": "n001", "host": "h", "why": "signal 9", "t": 2.0}]}}
    outcome = Outcome(tmp_path, died, ("n001 died at 2.0 s: signal 9",))
    monkeypatch.setattr(api, "run_processes", lambda *_: outcome)
    with pytest.raises(tf.RunFailed, match=rf"n001 died at 2.0 s: signal 9\n.* {tmp_path}") as failure:
        tf.run(SMALL, driver="processes")
    assert (failure.value.process, failure.value.log) == ("n001", str(tmp_path / "logs" / "n001.log"))


def test_ctrl_c_leaves_a_whole_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    interrupt_at(20, monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        tf.run(SMALL.set("target.steps", 50), out="early")
    result = tf.open("early")
    assert 0 < max(result.tracks["step"].to_pylist()) < 49
    assert result.metrics.frames.sent == 20


def test_a_program_may_run_often() -> None:
    """What stays of a run in a program: Rerun keeps two threads of each timeline's layout asleep, and no file open."""
    process = psutil.Process()
    tf.run(SMALL)
    threads, files = process.num_threads(), process.num_fds()
    for seed in range(3):
        tf.run(SMALL, seed=seed)
    assert process.num_fds() <= files  # fewer, if workers of a study before ended meanwhile
    assert process.num_threads() <= threads + 3 * 2


# --- studies ----------------------------------------------------------------------------------------------------------


def test_a_study_has_the_figures_of_single_runs_in_the_order_of_its_seeds() -> None:
    study = tf.study(SMALL, [4, 2, 7], n_jobs=2)
    assert [run.seed for run in study.results] == [4, 2, 7]
    single = tf.run(SMALL, seed=2)
    assert repeatable(study.results[1].metrics) == repeatable(single.metrics)
    assert study.results[1].tracks == single.tracks
    assert [p.name for p in Path("runs").iterdir()] == [single.path.name]


def test_the_table_of_a_study_has_a_row_for_each_seed_and_tracker() -> None:
    study = tf.study(SMALL, range(3), n_jobs=1)
    table = study.table.to_pydict()
    assert table["seed"] == [0, 0, 1, 1, 2, 2]
    assert table["tracker"] == [*study.results[0].metrics.trackers] * 3
    for row in study.table.to_pylist():
        metrics = study.results[row["seed"]].metrics
        assert row["rmse.position"] == metrics.trackers[row["tracker"]].rmse.position
        assert (row["frames.sent"], row["bytes.payload"]) == (metrics.frames.sent, metrics.bytes.payload)


def test_the_median_run_is_the_one_in_the_middle() -> None:
    study = tf.study(SMALL, range(5), n_jobs=1)
    errors = [run.metrics.trackers["imm-ukf"].rmse.position for run in study.results]
    assert study.median.metrics.trackers["imm-ukf"].rmse.position == np.median([e for e in errors if e is not None])


def test_a_study_leaves_its_tables_and_the_median_run(tmp_path: Path) -> None:
    study = tf.study(SMALL, range(3), n_jobs=1, out=tmp_path / "study")
    assert pq.read_table(tmp_path / "study" / "study.parquet") == study.table
    tracks = pq.read_table(tmp_path / "study" / "tracks.parquet")
    assert tracks.filter(np.array(tracks["seed"]) == 1).drop_columns("seed") == study.results[1].tracks
    median = tf.open(tmp_path / "study" / "median")
    assert repeatable(median.metrics) == repeatable(study.median.metrics)


def test_a_study_runs_where_joblib_is_told_to() -> None:
    with joblib.parallel_config(backend="threading"):
        study = tf.study(SMALL, range(2), n_jobs=2)
    assert study.table == tf.study(SMALL, range(2), n_jobs=1).table


def test_a_run_of_a_study_that_cannot_be_made_names_its_seed() -> None:
    nowhere = SMALL.set("target", {"path": "waypoints", "waypoints": [[0, 9000, 9000], [9, 9000, 9100]]})
    with pytest.raises(tf.ScenarioError, match=r"with seed 8: .*never comes in range"):
        study_run(checked(nowhere, 8))
    with pytest.raises(tf.ScenarioError, match=r"^sensor.threshold: the target never comes in range"):
        tf.study(nowhere, [8], n_jobs=1)  # before any run


# --- in a notebook ----------------------------------------------------------------------------------------------------


def test_names_and_files_are_as_good_as_scenarios(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(SMALL.to_toml())
    by_file, by_path = tf.run("mine.toml", seed=4), tf.study(tmp_path / "mine.toml", [4])
    assert repeatable(by_file.metrics) == repeatable(tf.run(SMALL, seed=4).metrics)
    assert repeatable(by_path.results[0].metrics) == repeatable(by_file.metrics)
    (one,) = tf.study("spcpf", [1], n_jobs=1).results
    assert one.metrics.scenario == "zhai-spcpf"


def test_a_result_shows_its_figures_and_verdicts_and_where_its_report_is() -> None:
    result = tf.run(SMALL, out="r")
    page = Reader(result._repr_html_())
    tracker = result.metrics.trackers["spcpf"]
    assert f"spcpf {tracker.verdict} {tracker.rmse.position:.2f}" in page.text
    assert "report" not in page.text  # none was written here
    assert result.report() == Path("r/report.html")
    assert ("a", {"href": "r/report.html", "target": "_blank"}) in Reader(result._repr_html_()).tags
    Path("r/report.html").write_text("old")
    assert result.report().read_text() == "old"
    assert "old" not in result.report(anew=True).read_text()[:10]


def test_a_result_draws_the_field_and_its_errors_and_breaks_the_lines_where_there_was_no_track() -> None:
    down = {"kind": "restart", "nodes": ["fusion"], "at_s": 3, "until_s": 7}
    result = tf.run(SMALL.set("faults", [down]).set("fusion.trackers", ["spcpf"]))
    figure = result.plot()
    field, errors = figure.axes
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["sensor", "true path", "spcpf"]
    assert field.get_xlabel() == "east [m]"
    (line,) = errors.get_lines()
    times, values = line.get_xydata().T
    off = np.isnan(values)
    assert off.any()
    assert not off.all()
    track = result.tracks.to_pydict()
    known = {t: np.hypot(x - u, y - v) for t, x, y, u, v in zip(
        *(track[key] for key in ("t_s", "x", "y", "true_x", "true_y")), strict=True) if x is not None}  # fmt: skip
    assert dict(zip(times[~off], values[~off], strict=True)) == pytest.approx(known)
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_a_study_shows_itself_and_draws_what_varies() -> None:
    study = tf.study(SMALL, range(3), {"field.spacing_m": [50, 60], "tracker": ["ekf", "ukf"]}, n_jobs=1)
    assert study.table.column_names[:3] == ["field.spacing_m", "seed", "tracker"]
    page = Reader(study._repr_html_())
    assert page.text.startswith("zhai-spcpf : 12 runs field.spacing_m tracker tracked")
    assert page.text.count("ekf") == page.text.count("ukf") == 2
    assert {axes.get_xlabel() for axes in study.plot("field.spacing_m").axes} == {"", "field.spacing_m"}
    assert {axes.get_xlabel() for axes in study.plot("tracker").axes} == {"", "tracker"}
    assert study.pareto("bytes.on_air").axes[0].get_xlabel() == "bytes on the air [bytes]   (less is better)"
    with pytest.raises(
        tf.ScenarioError, match=r"axis: .link.loss. is not varied; expected one of field\.spacing_m, tracker"
    ):
        study.plot("link.loss")
    for pair, said in (
        (("energy",), r"^x: there is no figure .energy."),
        (("energy_j.total", "energy"), r"^y: there is no figure .energy."),
        (("rmse.position",), r"^x, y: both are rmse.position; expected two figures"),
        (("frames.sent", "lifetime_s.first_death"), r"^x, y: no run has both figures, frames.sent and lifetime_s.fir"),
    ):
        with pytest.raises(tf.ScenarioError, match=said):
            study.pareto(*pair)


def test_values_of_numpy_are_values(tmp_path: Path) -> None:
    vary = {"field.nodes": np.array([9, 16]), "link.loss": [np.float64(0.1), 0.2]}
    study = tf.study(SMALL.set("target.steps", 3), np.arange(1, 2), vary, out=tmp_path / "s", n_jobs=1)
    assert [axis.values for axis in study.axes] == [(9, 16), (0.1, 0.2)]
    said = json.loads((tmp_path / "s" / "manifest.json").read_text())["study"]
    assert said["vary"] == {"field.nodes": [9, 16], "link.loss": [0.1, 0.2]}
    assert said["seeds"] == [1]


def test_without_pandas_it_is_said_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    study = tf.study(SMALL, [1], n_jobs=1)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(tf.TrackfieldError, match=r"needs pandas, .* pip install 'trackfield\[notebook\]' brings it"):
        study.to_pandas()


def test_a_study_in_a_folder_goes_on_where_it_was(tmp_path: Path) -> None:
    vary = {"field.spacing_m": [50, 60]}
    first = tf.study(SMALL, [1], vary, out=tmp_path / "s", n_jobs=1)
    before = {file: file.stat().st_mtime_ns for file in (tmp_path / "s" / "results").rglob("*.parquet")}
    more = tf.study(SMALL, [1, 2], vary, out=tmp_path / "s", n_jobs=1)
    assert (len(first.results), len(more.results), len(before)) == (2, 4, 2)
    assert {file: file.stat().st_mtime_ns for file in before} == before
    assert more.results[0].tracks == first.results[0].tracks == tf.study(SMALL, [1], vary, n_jobs=1).results[0].tracks
    assert (tmp_path / "s" / "study.html").exists()


# --- comparisons ------------------------------------------------------------------------------------------------------


def test_runs_are_compared_as_text_and_as_a_table() -> None:
    one, other = tf.run(SMALL, seed=1, out="one"), tf.run(SMALL, seed=2, out="other")
    comparison = tf.compare([one, "other"])
    assert comparison.table["path"].to_pylist() == ["one", "one", "other", "other"]
    assert comparison.table["rmse.position"].to_pylist() == [
        tracker.rmse.position for run in (one, other) for tracker in run.metrics.trackers.values()
    ]
    error = one.metrics.trackers["spcpf"].rmse.position
    assert error is not None
    assert number(error) in str(comparison)
    assert "other" in str(comparison)


# --- bad input --------------------------------------------------------------------------------------------------------


def some_folder() -> str:
    Path("full").mkdir()
    Path("full", "something").touch()
    return "full"


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: tf.run(5), 'scenario: is 5; expected a scenario, or the name or file of one, like "zhai-spcpf"'),
        (lambda: tf.run("spfcp"), "unknown scenario 'spfcp'; .*expected one of bus"),
        (lambda: tf.study("spfcp", range(2)), "unknown scenario 'spfcp'; .*expected one of bus"),
        (lambda: tf.study(SMALL, [-1]), "seed: is -1; expected"),
        (lambda: tf.study(SMALL, [1, 1]), "seeds: some are given twice; expected each seed once"),
        (lambda: tf.study(SMALL, [1], {"link.loss": [0.1]}), "link.loss: has one value, 0.1; expected two values or"),
        (lambda: tf.study(SMALL, [1], {"link.loss": 0.1}), "link.loss: is 0.1, which is no list; expected two values"),
        (lambda: tf.study(SMALL, [1], {"link.model": "ideal"}), "link.model: is 'ideal', which is no list; expected"),
        (lambda: tf.study(SMALL, 5), "seeds: is 5, which is no list; expected one or more, like range"),
        (lambda: tf.study(SMALL, [1], {"link.modle": ["a", "b"]}), "link.modle: unknown; did you mean model"),
        (lambda: tf.run(SMALL, driver="virtaul"), "driver: is 'virtaul'; did you mean virtual.; expected virtual or"),
        (lambda: tf.run(SMALL, seed=-1), "seed: is -1; expected"),
        (lambda: tf.run(SMALL, driver="processes", speed=0), "^speed: is 0; expected more than 0"),
        (
            lambda: tf.run(SMALL, speed=50),
            '^speed: virtual time goes as fast as the machine can; expected driver="proc',
        ),
        (lambda: tf.run(SMALL, out=some_folder()), "^full: out: the folder is not empty; expected an empty"),
        (lambda: tf.study(SMALL, [1], out=some_folder()), "^full: out: the folder is not empty"),
        (lambda: tf.study(SMALL, []), "seeds: none given; expected one or more"),
        (lambda: tf.run(SMALL.set("fusion.trackers", ["spcfp"])), "unknown tracker .*spcpf"),
        (lambda: SMALL.set("link.modle", "ideal"), "link.modle: unknown; did you mean model"),
        (lambda: tf.open("nowhere"), "nowhere: has no metrics.json; expected the folder of a finished run"),
        (lambda: tf.compare([]), "runs: 0 given; expected two runs or more"),
    ],
)
def test_bad_input_gets_one_clear_error(call: Any, said: str) -> None:
    with pytest.raises(tf.ScenarioError, match=said):
        call()
    assert not Path("runs").exists()


def test_errors_are_one_family() -> None:
    assert issubclass(tf.ScenarioError, tf.TrackfieldError)
    assert issubclass(tf.RunFailed, tf.TrackfieldError)


# --- names ------------------------------------------------------------------------------------------------------------


def test_every_name_is_there_for_people_and_for_type_checkers() -> None:
    tree = ast.parse(Path(tf.__file__).read_text())
    typed = {
        name.name
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for line in node.body
        if isinstance(line, ast.ImportFrom)
        for name in line.names
    }
    assert sorted(typed) == sorted(tf.__all__)
    assert all(getattr(tf, name).__doc__ for name in tf.__all__)
    assert set(tf.__all__) <= set(dir(tf))


def test_the_version_is_that_of_the_package() -> None:
    assert tf.__version__ == version("trackfield")
    assert "__version__" in dir(tf)


def test_the_package_alone_loads_nothing_heavy() -> None:
    code = "import sys, trackfield; print({'numpy', 'pydantic', 'launcher', 'pyarrow'} & set(sys.modules))"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "set()\n"
