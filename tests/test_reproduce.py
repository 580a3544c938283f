"""``trackfield reproduce``: what is stored is not run again, and every verdict comes from figures."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from launcher.reproduce.case import Case
from launcher.reproduce.command import reproduce
from launcher.reproduce.paper import Paper
from launcher.reproduce.papers import PAPERS
from launcher.reproduce.papers.zhai import PAPER
from launcher.reproduce.papers.zhai.cases import CASES
from launcher.reproduce.papers.zhai.claims import claims
from launcher.reproduce.realisation import realise, typical
from launcher.reproduce.records import Record, measure
from launcher.reproduce.report import markdown
from launcher.reproduce.scores import Field, Results, Score, usual_scores
from launcher.reproduce.store import Store
from launcher.reproduce.tables import UNKNOWN, Band
from launcher.reproduce.timing import heard
from launcher.study.store import study_folder
from tests.command_line import Call, trackfield
from tests.running import PATIENCE_S, killed_on_failure, until
from trackfield.filters.trackers import make_tracker

__all__ = ["trackfield"]

DOCS = Path(__file__).parents[1] / "docs"


def short(name: str = "s1", steps: int = 6) -> Case:
    case = CASES[name]
    return replace(case, settings={**case.settings, "target.steps": steps})


def same(a: Record, b: Record) -> bool:
    """Bit for bit."""
    return all(np.array_equal(getattr(a, f.name), getattr(b, f.name), equal_nan=True) for f in fields(Record))


# --- runs, stored -----------------------------------------------------------------------------------------------------


def test_a_study_that_was_stopped_goes_on_where_it_was(tmp_path: Path) -> None:
    case, seeds = short(), range(1, 5)
    store = Store(tmp_path, [case])
    assert store.missing(seeds) == [("s1", seed) for seed in seeds]
    for _ in store.fill(store.missing(seeds)[:2]):
        pass
    before = {seed: store.file("s1", seed).stat().st_mtime_ns for seed in (1, 2)}
    again = Store(tmp_path, [case])
    assert again.missing(seeds) == [("s1", 3), ("s1", 4)]
    for _ in again.fill(again.missing(seeds)):
        pass
    assert {seed: store.file("s1", seed).stat().st_mtime_ns for seed in (1, 2)} == before
    assert all(same(one, measure(case, seed)) for seed, one in enumerate(again.records("s1", seeds), 1))


@pytest.mark.parametrize(
    "changed",
    [
        lambda case: replace(case, settings={**case.settings, "sensor.doa_sd_deg": 2.0}),
        lambda case: replace(case, trackers={**case.trackers, "spcpf": {"nominals": 14}}),
    ],
)
def test_another_scenario_is_another_study(tmp_path: Path, changed: Callable[[Case], Case]) -> None:
    case = short()
    assert Store(tmp_path, [case]).file("s1", 1) == Store(tmp_path, [case]).file("s1", 1)
    assert Store(tmp_path, [case]).file("s1", 1) != Store(tmp_path, [changed(case)]).file("s1", 1)


def test_other_code_is_another_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = Store(tmp_path, [short()]).file("s1", 1)
    monkeypatch.setattr("launcher.reproduce.store.code_digest", lambda: "other")
    assert Store(tmp_path, [short()]).file("s1", 1) != before


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.mark.rendered
def test_a_study_is_interrupted_and_goes_on(trackfield: Call, tmp_path: Path) -> None:
    folder = tmp_path / "runs" / "reproduce-zhai"
    done = interrupted(tmp_path, folder)
    said = trackfield("reproduce", "zhai", "--runs", "1", "--json")
    assert said.code == 0
    assert f"{done} of {len(CASES)} runs exist already" in said.err
    assert said.err.endswith("next: trackfield view runs/reproduce-zhai/run\n")

    summary = json.loads(said.out)
    assert said.out == (folder / "results.json").read_text()
    results = Results.of_plain(summary, Score)
    open_yet = {claim["name"] for claim in summary["claims"] if claim["verdict"] == UNKNOWN}
    assert {claim["name"] for claim in summary["claims"]} - open_yet <= {"Cheaper than the bootstrap"}  # of one run
    for case in ("s1-78", "s3"):  # as if it had never been interrupted
        records = [measure(CASES[case], 1)]
        scores = {
            name: replace(score, ends=plain_ends(score)) for name, score in usual_scores(CASES[case], records).items()
        }
        assert (results.scores[case], results.fields[case]) == (scores, Field.of(records))
    assert (folder / "report.md").read_text() == markdown(PAPER, results)
    assert [claim["name"] for claim in summary["claims"]] == [claim.name for claim in claims(results)]
    assert_complete(folder, results)


def plain_ends(score: Score) -> dict[str, list[float | None]]:
    """As a file has them."""
    return {name: list(ends) for name, ends in score.ends.items()}


def interrupted(cwd: Path, folder: Path) -> int:
    """Begins a long study, stops it as a terminal does, and tells how many runs of the first seed are there."""
    command = [sys.executable, "-m", "launcher.cli", "reproduce", "zhai", "--runs", "1000"]
    with (
        subprocess.Popen(
            command, cwd=cwd, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, process_group=0
        ) as study,
        killed_on_failure(study),
    ):
        until(lambda: list(folder.rglob("*.npz")))
        os.killpg(study.pid, signal.SIGINT)
        out, err = study.communicate(timeout=PATIENCE_S)
    done = len(list(folder.rglob("*.npz")))
    assert (study.returncode, out) == (130, "")
    assert 0 < done < 1000
    assert f"interrupted: {1000 * len(CASES) - done} of {1000 * len(CASES)} runs are left" in err
    assert "Traceback" not in err
    assert not (folder / "results.json").exists()
    return len(list(folder.rglob("00001.npz")))


def assert_complete(folder: Path, results: Results[Score]) -> None:
    """Figures, tables and a run are there, and agree with the results."""
    pictures = {f"{name}.png" for name, *_ in PAPER.figures}
    assert {file.name for file in (folder / "figures").iterdir()} == pictures
    assert pictures > {f"fig{number:02}.png" for number in range(3, 14)}
    runs = pq.read_table(folder / "runs.parquet").to_pylist()
    assert {(row["case"], row["tracker"]) for row in runs} == {(c, t) for c in CASES for t in CASES[c].trackers}
    (one,) = [row for row in runs if (row["case"], row["tracker"]) == ("s2", "spcpf")]
    assert one["rmse_position"] == pytest.approx(results.scores["s2"]["spcpf"].position, rel=1e-12)
    steps = pq.read_table(folder / "steps.parquet").to_pylist()
    of_one = [row["rmse_x"] for row in steps if (row["case"], row["tracker"]) == ("s2", "spcpf")]
    assert np.mean(of_one) == pytest.approx(results.scores["s2"]["spcpf"].mean_x, rel=1e-12)
    run = json.loads((folder / "run" / "metrics.json").read_text())
    assert run["seed"] == 1
    assert run["trackers"]["spcpf"]["rmse"]["position"] == pytest.approx(results.scores["s1"]["spcpf"].position)


def test_the_folder_of_another_kind_of_study_is_left_alone(trackfield: Call, tmp_path: Path) -> None:
    study_folder(tmp_path / "s")
    said = trackfield("reproduce", "zhai", "--runs", "1", "--out", "s")
    assert said.code == 2
    assert "s: --out: the folder is not empty; expected an empty or new one, or that of an earlier" in said.err


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["reproduce", "zhay"], ["PAPER: unknown paper 'zhay'", "did you mean zhai?", "zhai"]),
        (["reproduce", "zhai", "--runs", "0"], ["--runs: is 0", "expected 1 or more"]),
        (["reproduce", "zhai", "--out", "full"], ["full: --out: the folder is not empty"]),
    ],
)
def test_what_cannot_be_reproduced(trackfield: Call, tmp_path: Path, arguments: list[str], parts: list[str]) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("years of work")
    said = trackfield(*arguments)
    assert (said.code, said.out, said.err.count("\n")) == (2, "", 1)
    assert all(part in said.err for part in parts)
    assert {file.name for file in tmp_path.rglob("*")} == {"full", "thesis.tex"}


def toy() -> Paper[Field]:
    """One without tables, claims, pictures and times, and with another score than ``Score``."""
    return Paper(
        *("toy", "Toy (2001)", {"s1": short().only("ekf")}),
        scores=lambda _, records: {"ekf": Field.of(records)},
        contrasts=lambda *_: {},
        tables=lambda _: {},
        claims=lambda _: [],
        parts=lambda results: [("Frames", f"{results.scores['s1']['ekf'].frames:.1f}")],
        figures=[],
        draw=lambda *_: {"s1": 2},
        run=short().only("ekf"),
    )


def test_another_paper_is_done_by_the_same_engine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("launcher.reproduce.command.paper_named", lambda _: toy())
    study, field = reproduce("toy", 2, tmp_path), Field.of([measure(toy().run, seed) for seed in (1, 2)])
    assert study.summary["scores"] == {"s1": {"ekf": asdict(field)}}
    assert [study.summary[name] for name in ("tables", "claims", "times")] == [{}, [], {}]
    assert f"\n\n## Frames\n\n{field.frames:.1f}\n\n" in study.report
    assert json.loads((tmp_path / "run" / "metrics.json").read_text())["seed"] == 2


def test_the_engine_names_no_paper() -> None:
    texts = [file.read_text() for file in (DOCS.parent / "launcher" / "reproduce").glob("*.py")]
    assert [name for name in PAPERS if any(name in text for text in texts)] == []


# --- figures ----------------------------------------------------------------------------------------------------------


def test_scores_by_hand() -> None:
    errors = np.zeros((2, 2, 4))  # runs, steps
    errors[:, 0, 0] = 3.0, 4.0
    errors[1, 1, 1] = 60.0
    score = Score.of(errors)
    x = np.sqrt(25 / 2)
    assert (score.mean_x, score.var_x) == pytest.approx((x / 2, x**2 / 4))
    y = np.sqrt(3600 / 2)
    assert (score.mean_y, score.var_y) == pytest.approx((y / 2, y**2 / 4))
    assert score.position == pytest.approx(np.sqrt((9 + 16 + 3600) / 4))
    assert score.median_run == pytest.approx((np.sqrt(9 / 2) + np.sqrt(3616 / 2)) / 2)
    assert score.median_x == pytest.approx((3 + 4) / np.sqrt(2) / 2)
    assert (score.lost, score.largest) == (0.5, 60.0)


def test_a_track_that_ended_is_lost() -> None:
    errors = np.ones((2, 3, 4))
    errors[1, 2] = np.nan
    score = Score.of(errors)
    assert (score.lost, score.position) == (0.5, pytest.approx(np.sqrt(2)))


def test_a_run_is_the_same_with_fewer_trackers() -> None:
    case = short("s2")
    record, run = measure(case, 3), realise(case.only("bootstrap"), 3)
    (estimate,) = run.estimates.values()
    place = list(case.trackers).index("bootstrap")
    assert np.array_equal(estimate - run.truth[1:], record.errors[place])
    assert len(run.sensors) == 121
    assert 0 < len(run.active) < 20


def test_trackers_are_timed_on_what_the_centre_fuses() -> None:
    case = short()
    given, record, run = heard(case, 2), measure(case, 2), realise(case.only("spcpf"), 2)
    assert [len(some) for some in given.reports] == record.reports.tolist()
    tracker, estimates = make_tracker("spcpf"), []
    state = given.begun(tracker)
    for some in given.reports:
        state, estimate = given.stepped(tracker, state, some, given.rng("spcpf", some))
        estimates.append(estimate.mean)
    assert np.allclose(estimates, run.estimates["spcpf"], rtol=0, atol=1e-9)


def test_the_typical_run_is_the_median_one() -> None:
    case = short().only("spcpf")
    errors = [1.0, 9.0, 2.0, 0.5, 4.0]
    blank = np.zeros(3), np.full(3, np.nan), np.zeros(4)
    records = [Record(np.full((1, 3, 4), error), blank[0].astype(np.int64), *blank[1:]) for error in errors]
    assert typical(case, records, ["spcpf"]) == 2


def test_what_was_reached_before_is_reached_again() -> None:
    """Means of 12 runs; an independent implementation had 1.55 m and 1.05 m."""
    case = CASES["s1"].only("spcpf", "fix-imm-ukf")
    records = [measure(case, seed) for seed in range(1, 13)]
    scores = usual_scores(case, records)
    assert scores["spcpf"].position in Band(1.2, 1.7)
    assert scores["fix-imm-ukf"].position in Band(0.9, 1.15)
    assert scores["spcpf"].lost == scores["fix-imm-ukf"].lost == 0
    assert Field.of(records).active == pytest.approx(4.0, abs=0.2)
