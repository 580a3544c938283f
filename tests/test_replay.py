"""The reports of a finished run, fused again: nothing changes unless something was changed."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import trackfield as tf
from launcher.plan.prepare import load, planned
from launcher.record.folder import keep, prepare_folder, scenario_digest
from launcher.record.journal import METRICS
from launcher.run import run_processes, run_virtual
from launcher.show import Quiet
from launcher.study.compare import differences
from launcher.study.replay import caveats, replay
from tests.command_line import Call, trackfield
from tests.interrupting import interrupt_at
from tests.rrd import entities, read
from trackfield.filters.trackers import TRACKERS

__all__ = ["trackfield"]

LATE = ("link.model=gilbert_elliott", "link.delay_ms=100", "link.jitter_ms=400", "fusion.max_age_s=2.5")
DEAD = "faults=[{kind='restart', nodes=['fusion'], at_s=12.4, until_s=17.7}]"
PARTICLES = ("fusion.trackers=['bootstrap']", "fusion.options.bootstrap={n=500, keeps='particles'}")
CLOCKS = ("clock.offset_ms=40", "clock.drift_ppm=60", "clock.resync_s=10", "clock.sync=true")
STRICKEN = (
    "faults=[{kind='freeze', nodes=['fusion'], at_s=6, until_s=9},"
    "{kind='clock_jump', nodes=['fusion'], at_s=20, jump_ms=700},"
    "{kind='partition', share=0.5, at_s=12, until_s=16}, {kind='stuck', nodes=['n060'], at_s=0}]"
)
COMMANDED = ("sensor.threshold=adaptive", "fusion.target_sd_m=3")


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports have tests of their own, and take longer than all else here."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("launcher.run._report", lambda *_: "")


def virtual(settings: Sequence[str], name: str = "run", *, steps: int = 30, trackers: Sequence[str] = ()) -> Path:
    """The folder of a run of ``spcpf`` in virtual time."""
    scenario = load("spcpf", settings=[f"target.steps={steps}", *settings], trackers=trackers)
    folder = prepare_folder(Path(name), scenario.name, scenario.seed)
    keep(scenario, folder)
    run_virtual(planned(scenario), folder)
    return folder


# --- nothing was changed ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "bites"),
    [
        (("link.model=fixed", "link.loss=0.3"), "frames.lost.radio"),
        (LATE, "frames.late"),
        ((*LATE, DEAD), "frames.lost.dead"),
        ((DEAD, "fusion.smooth_lag=3"), "frames.lost.dead"),
        ((DEAD, *PARTICLES), "frames.lost.dead"),
        ((*LATE, "fusion.prior=none", "fusion.smooth_lag=3"), "frames.late"),
        (CLOCKS, "clock_error_ms.rms"),
        ((*LATE, STRICKEN), "frames.lost.frozen"),
        ((*CLOCKS, *COMMANDED, DEAD, "link.model=lognormal_prr"), "frames.by_kind.threshold.sent"),
        (("energy.centre_battery_j=0.5",), "frames.lost.dead"),
    ],
)
def test_the_same_trackers_give_the_same_tracks(settings: Sequence[str], bites: str) -> None:
    run = virtual(settings)
    figure = before = json.loads((run / METRICS).read_text())
    for part in bites.split("."):
        figure = figure[part]
    assert figure > 0
    after = replay(run, out=Path("again"))
    assert differences(run, after.folder, 1e-9) == []
    changed = {key for key in before if before[key] != after.metrics[key]}
    assert changed <= {"driver", "wall_s", "cpu_s"}
    assert after.exit_code == 0


def test_a_run_over_processes_is_replayed_as_well() -> None:
    scenario = load("spcpf", settings=["target.steps=12", "field.nodes=16", *LATE])
    plan = planned(scenario, speed=4)
    folder = prepare_folder(Path("run"), scenario.name, scenario.seed)
    keep(scenario, folder)
    outcome = run_processes(plan, folder, Quiet())
    assert outcome.metrics["frames"]["late"] > 0
    after = replay(folder, out=Path("again"))
    if not caveats(outcome.metrics):  # else the machine was too busy to tell
        assert differences(folder, after.folder, 1e-9) == []
    assert (after.metrics["driver"], after.metrics["timing"]["speed"]) == ("replay", None)
    assert after.metrics["host_latency_ms"] == outcome.metrics["host_latency_ms"]


@pytest.mark.parametrize("settings", [(), LATE])
def test_a_run_that_was_ended_early_is_replayed_up_to_there(
    settings: Sequence[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupt_at(60, monkeypatch)
    run = virtual(settings)
    steps = set(tf.open(run).tracks["step"].to_pylist())
    assert 10 < max(steps) < 29
    after = replay(run)
    assert differences(run, after.folder, 1e-9) == []
    assert after.metrics["trackers"] == json.loads((run / METRICS).read_text())["trackers"]


def test_a_replay_can_be_replayed() -> None:
    run = virtual(LATE)
    once = replay(run, ["bootstrap"]).folder
    twice = replay(once).folder
    assert differences(once, twice, 1e-9) == []
    assert once.parent == Path("runs")
    assert once.name.startswith("zhai-spcpf-1-")


# --- what can be changed ----------------------------------------------------------------------------------------------


def test_another_tracker_does_what_it_would_have_done_in_the_run() -> None:
    replayed = replay(virtual(LATE), ["ekf", "bootstrap"]).folder
    run = virtual(LATE, "other", trackers=["ekf", "bootstrap"])
    assert differences(run, replayed, 1e-9) == []
    assert tf.open(replayed).metrics.trackers == tf.open(run).metrics.trackers
    assert tf.open(replayed).metrics.latency_ms == tf.open(run).metrics.latency_ms
    assert tf.Scenario.load(replayed / "scenario.toml").fusion.trackers == ("ekf", "bootstrap")


def test_without_late_reports_it_is_a_run_in_which_they_do_not_count() -> None:
    run = virtual(LATE)
    replayed = replay(run, drop_late=True).folder
    assert differences(virtual((*LATE[:-1], "fusion.max_age_s=0"), "strict"), replayed, 1e-9) == []
    assert differences(run, replayed, 1e-9) != []
    assert tf.open(replayed).metrics.bound == tf.open("strict").metrics.bound


def test_a_tracker_of_ones_own_sees_recorded_reports_from_python(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(TRACKERS, "registered", {})
    tf.register_tracker("mine", TRACKERS["ekf"])
    run = tf.open(virtual(LATE, steps=10))
    result = tf.replay(run, ["mine", "ekf"], drop_late=True, out="again")
    mine, ekf = result.metrics.trackers.values()
    assert (result.path, mine) == (Path("again"), ekf)
    command = json.loads(Path("again", "manifest.json").read_text())["command"]
    assert command == ["trackfield", "replay", "run", "--tracker", "mine", "--tracker", "ekf", "--drop-late"]
    with pytest.raises(tf.ScenarioError, match=r"^again: out: the folder is not empty"):
        tf.replay(run, out="again")


def test_variants_of_a_tracker_are_known() -> None:
    run = virtual(["fusion.options.n5={tracker='spcpf', nominals=5}"], steps=10)
    assert replay(run, ["n5"]).metrics["trackers"].keys() == {"n5"}


# --- the folder -------------------------------------------------------------------------------------------------------


def test_the_folder_is_one_like_any_other(trackfield: Call) -> None:
    virtual((*LATE, STRICKEN))
    said = trackfield("replay", "run", "--tracker", "ekf", "--drop-late", "--out", "again", "--json")
    assert said.code == 0
    assert json.loads(said.out) == json.loads(Path("again", METRICS).read_text())
    assert "run folder: again" in said.err
    assert {file.name for file in Path("again").iterdir()} == {file.name for file in Path("run").iterdir()}
    assert Path("again", "messages.parquet").read_bytes() == Path("run", "messages.parquet").read_bytes()
    command = json.loads(Path("again", "manifest.json").read_text())["command"]
    assert command[:3] == ["trackfield", "replay", "run"]
    assert trackfield("compare", "run", "again").code == 0
    assert trackfield("report", "again").code == 0
    assert "replay of recorded reports" in Path("again", "report.html").read_text()


def test_a_centre_that_died_unplanned_is_fused_again_as_long_as_it_tracked(tmp_path: Path) -> None:
    """In one run it was away for a while as planned, in the other nobody knows why: the reports are the same."""
    run, twin = virtual((*LATE, DEAD)), Path("twin")
    shutil.copytree(run, twin)
    scenario = (twin / "scenario.toml").read_text()
    (twin / "scenario.toml").write_text(scenario[: scenario.index("[[faults]]")])
    manifest = json.loads((twin / "manifest.json").read_text()) | {"scenario": scenario_digest(twin)}
    (twin / "manifest.json").write_text(json.dumps(manifest))
    planned_one, unplanned = (replay(one, out=tmp_path / f"again-{one.name}").folder for one in (run, twin))
    assert differences(run, planned_one, 1e-9) == []
    assert differences(planned_one, unplanned, 1e-9) == []


def test_what_a_track_used_is_fused_though_the_books_do_not_say_that_it_came() -> None:
    """A centre that was killed could not say what it took in last: those frames stand there as dead."""
    run = virtual((), steps=8)
    table = pq.read_table(run / "messages.parquet").to_pydict()
    table["outcome"] = ["dead" if step == 8 else was for step, was in zip(table["step"], table["outcome"], strict=True)]
    pq.write_table(pa.table(table, schema=pq.read_schema(run / "messages.parquet")), run / "messages.parquet")
    again = replay(run).folder
    assert [what for what in differences(run, again, 1e-9) if what.startswith("tracks")] == []


def test_the_timeline_has_frames_faults_and_the_new_tracks() -> None:
    run = virtual((*LATE, DEAD))
    again = replay(run, ["ekf"]).folder
    old, new = entities(run / "run.rrd"), entities(again / "run.rrd")
    assert {name for name in new if "ekf" in name}
    assert not {name for name in new if "spcpf" in name}
    assert not {name for name in old if "ekf" in name}
    said = {"/messages/doa": "TextLog:text", "/faults": "TextLog:text", "/state/fusion": "StateChange:state"}
    for entity, component in said.items():
        before, after = (sorted(read(one / "run.rrd", entity, component), key=str) for one in (run, again))
        assert before == after != [], entity


def test_what_the_machine_did_is_said(trackfield: Call) -> None:
    run = virtual((), steps=5)
    metrics = json.loads((run / METRICS).read_text())
    assert caveats(metrics) == []
    metrics["timing"]["host_late"] = 3
    metrics["recorder"]["dropped"] = 5
    (run / METRICS).write_text(json.dumps(metrics))
    said = trackfield("replay", "run")
    assert said.code == 0
    said = said.err
    assert "note: 3 events were handled out of order in the run" in said
    assert "note: 5 frames of the run never reached the recorder" in said


# --- bad input --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("launcher.run._report", lambda *_: "")
        return virtual((), str(tmp_path_factory.mktemp("finished") / "run"), steps=3)


def without(file: str, run: Path) -> None:
    (run / file).unlink()


def older(run: Path) -> None:
    file = run / "messages.parquet"
    pq.write_table(pq.read_table(file).drop_columns("payload"), file)


def no_figures(run: Path) -> None:
    (run / METRICS).write_text("{}")


@pytest.mark.parametrize(
    ("spoil", "arguments", "said"),
    [
        (None, ("--tracker", "spcfp"), "unknown tracker 'spcfp'; did you mean spcpf?"),
        (None, ("--out", "run"), "run: --out: the folder is not empty; expected an empty or new one"),
        (older, (), "messages.parquet: was written by an older version; expected a run by this version"),
        (lambda run: without(METRICS, run), (), "run: has no metrics.json; expected the folder of a finished run"),
        (lambda run: without("messages.parquet", run), (), "run: has no messages.parquet"),
        (lambda run: without("scenario.toml", run), (), "run: has no scenario.toml; expected"),
        (no_figures, (), "metrics.json: scenario: is missing; expected the figures"),
    ],
)
def test_bad_input_gets_one_message(trackfield: Call, finished: Path, spoil, arguments, said) -> None:
    shutil.copytree(finished, "run")
    if spoil:
        spoil(Path("run"))
    ended = trackfield("replay", "run", *arguments)
    assert ended.code == 2
    assert said in ended.err
    assert ended.err.count("\n") == 1
    assert ended.out == ""
    assert not Path("runs").exists()


def test_a_run_that_is_not_there(trackfield: Call) -> None:
    ended = trackfield("replay", "nowhere", "--tracker", "ekf")
    assert (ended.code, ended.err.count("\n")) == (2, 1)
    assert "nowhere: has no metrics.json; expected the folder of a finished run" in ended.err
