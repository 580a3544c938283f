"""``trackfield reproduce PAPER --kernels``: runs of bare filters, spread over cores, and what is said of them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import typer

from launcher.reproduce.intervals import Interval
from launcher.reproduce.kernels.command import reproduce_kernels
from launcher.reproduce.kernels.draws import generators, normals
from launcher.reproduce.kernels.scores import lost, mean, mean_rmse, percentile, ratio, rmse, share_lost
from launcher.reproduce.kernels.study import Experiment, Figures, Found, Kernels, done
from launcher.reproduce.kernels.turns import taken
from launcher.reproduce.papers import KERNELS, PAPERS, holds_roles, kernels_named
from launcher.reproduce.tables import Claim, Row, rows_table
from launcher.study.store import study_folder
from tests.command_line import Call, trackfield

__all__ = ["trackfield"]


def walks(steps: int, seeds: Sequence[int]) -> Figures:
    """Random walks, and where each ends."""
    errors = normals(generators(seeds, "walk"), steps, 2).cumsum(axis=1)
    return {"errors": errors, "seed": np.array(seeds, float)}


def walking(batch: int = 3) -> dict[str, Experiment]:
    return {
        "short": Experiment(partial(walks, 4), batch),
        "long": Experiment(partial(walks, 40), batch, most=5),
    }


def toy() -> Kernels:
    def rows(found: Found) -> dict[str, list[Row]]:
        return {"errors": [Row(name, "none", "m", rmse(some["errors"])) for name, some in found.figures.items()]}

    return Kernels(
        *("toy", "Toy (2001)", walking()),
        tables=rows,
        claims=lambda found: [Claim("It runs", "always", f"{found.runs} runs", "holds")],
        parts=lambda found: [("Errors", rows_table(rows(found)["errors"]))],
        figures=[("walk", "one", "none")],
        draw=lambda folder, found: (folder / "walk.png").write_text(str(found.figures["long"]["errors"][0])) and None,
    )


def test_every_run_has_its_seed_and_no_experiment_more_runs_than_it_is_worth() -> None:
    found = done(walking(), 8)
    assert found["short"]["seed"].tolist() == [1, 2, 3, 4, 5, 6, 7, 8]
    assert found["long"]["seed"].tolist() == [1, 2, 3, 4, 5]


@pytest.mark.parametrize("batch", [1, 4, 100])
def test_runs_are_the_same_in_batches_of_any_size_and_more_runs_extend_fewer(batch: int) -> None:
    fewer, more = done(walking(batch), 6)["short"], done(walking(3), 9)["short"]
    assert np.array_equal(fewer["errors"], more["errors"][:6])
    assert not np.array_equal(fewer["errors"][0], fewer["errors"][1])


def test_a_study_leaves_a_report_figures_and_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("launcher.reproduce.kernels.command.kernels_named", lambda _: toy())
    study = reproduce_kernels("toy", 7, tmp_path / "out")
    assert study.report == (tmp_path / "out" / "report.md").read_text()
    assert "| It runs | always | 7 runs | holds |" in study.report
    summary = json.loads((tmp_path / "out" / "results.json").read_text())
    assert summary == study.summary | {"tables": summary["tables"]}
    errors = walks(4, range(1, 8))["errors"]
    pooled = np.sqrt(np.square(errors).sum(axis=-1).mean())
    assert summary["tables"]["errors"][0]["ours"][0] == pytest.approx(pooled, rel=1e-12)
    assert (tmp_path / "out" / "figures" / "walk.png").read_text() == str(walks(40, [1])["errors"][0])


def test_an_interrupted_study_says_so_and_leaves_no_results(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("launcher.reproduce.kernels.command.kernels_named", lambda _: toy())
    monkeypatch.setattr("launcher.reproduce.kernels.command.done", interrupted)
    with pytest.raises(typer.Exit) as stopped:
        reproduce_kernels("toy", 7, tmp_path)
    assert stopped.value.exit_code == 130
    assert "interrupted: nothing is kept" in capsys.readouterr().err
    assert not (tmp_path / "results.json").exists()


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["reproduce", "zhai", "--kernels"], ["--kernels: of 'zhai' there are runs of the whole system only"]),
        (["reproduce", "zhuo", "--kernels"], ["PAPER: unknown paper 'zhuo'", "did you mean zhou?"]),
        (["reproduce", "ozfidam"], ["PAPER: unknown paper 'ozfidam'", "did you mean ozfidan?"]),
        (["reproduce", "zhou", "--kernels", "--runs", "0"], ["--runs: is 0", "expected 1 or more"]),
        (["reproduce", "zhou", "--kernels", "--out", "full"], ["full: --out: the folder is not empty"]),
    ],
)
def test_what_there_is_not_is_said_in_one_line(
    trackfield: Call, tmp_path: Path, arguments: list[str], parts: list[str]
) -> None:
    study_folder(tmp_path / "full")
    said = trackfield(*arguments)
    assert (said.code, said.out, said.err.count("\n")) == (2, "", 1)
    assert all(part in said.err for part in parts)


def with_roles(runs: list[str]) -> Kernels:
    """A study with an experiment that runs roles, which notes that it ran."""

    def of_roles(seeds: Sequence[int]) -> Figures:
        runs.append("roles")
        return walks(4, seeds)

    both = {**walking(), "roles": Experiment(of_roles, roles=True)}
    return replace(toy(), experiments=both, with_roles=True)


def test_bare_filters_are_done_without_the_experiments_with_roles_beside_them(
    trackfield: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ran: list[str] = []
    monkeypatch.setattr("launcher.reproduce.kernels.command.kernels_named", lambda _: with_roles(ran))
    monkeypatch.setattr("launcher.reproduce.papers.kernels_named", lambda _: with_roles(ran))
    assert holds_roles("ozfidan")
    bare = trackfield("reproduce", "ozfidan", "--kernels", "--runs", "2")
    assert (bare.code, ran) == (0, [])
    assert "2 experiments on bare filters, 2 runs of each" in bare.err
    assert {row["case"] for row in _tables(tmp_path / "runs" / "reproduce-toy-kernels")} == {"short", "long"}
    whole = trackfield("reproduce", "ozfidan", "--runs", "2")
    assert (whole.code, ran) == (0, ["roles"])
    assert "2 experiments on bare filters, 1 with roles, 2 runs of each" in whole.err
    assert {row["case"] for row in _tables(tmp_path / "runs" / "reproduce-toy")} == {"short", "long", "roles"}


def _tables(folder: Path) -> list[dict[str, object]]:
    rows: list[dict[str, object]] = json.loads((folder / "results.json").read_text())["tables"]["errors"]
    return rows


def test_which_papers_have_roles_beside_their_bare_filters() -> None:
    assert {name: holds_roles(name) for name in (*PAPERS, *KERNELS)} == {
        "zhai": False, "yang": True, "yu": True, "zhou": True, "ozfidan": True,
    }  # fmt: skip


def test_the_engine_names_no_paper() -> None:
    folder = Path(reproduce_kernels.__code__.co_filename).parent
    texts = [file.read_text() for file in folder.glob("*.py")]
    assert texts
    assert [name for name in (*PAPERS, *KERNELS) if any(f'"{name}' in text for text in texts)] == []
    assert kernels_named("zhou").name == "zhou"


# --- figures ----------------------------------------------------------------------------------------------------------


def test_scores_by_hand() -> None:
    errors = np.zeros((2, 3, 4))  # runs, steps
    errors[0, :, 0], errors[1, 2, 1] = 3.0, 6.0
    assert rmse(errors).value == pytest.approx(np.sqrt((27 + 36) / 6))
    assert mean_rmse(errors).value == pytest.approx((2 * np.sqrt(4.5) + np.sqrt(22.5)) / 3)
    assert ratio(2 * errors, errors).value == pytest.approx(2)
    assert percentile(errors, 50).value == 3.0
    assert lost(errors, 5.0, 1).tolist() == [False, True]
    assert lost(errors, 5.0, 3).tolist() == [False, True]
    assert lost(np.flip(errors, axis=1), 5.0, 2).tolist() == [False, False]
    assert share_lost(errors, 5.0, 1).value == 0.5
    assert mean(np.array([[1.0, 2.0], [3.0, 6.0]])).value == 3.0


def test_the_interval_of_a_percentile_holds_it() -> None:
    """Of 300 runs of independent errors the true median of the distance, sqrt(2 log 2), is 3 standard errors away with
    probability 0.003; the interval of 95 % is widened to that."""
    errors = normals(generators(range(300), "percentile"), 20, 2)
    value, low, high = percentile(errors, 50)
    assert low is not None and high is not None
    half = 1.5 * max(high - value, value - low)
    assert value - half < np.sqrt(2 * np.log(2)) < value + half
    assert 0 < high - low < 0.1
    assert percentile(errors[:1], 50) == Interval(float(np.median(np.linalg.norm(errors[0], axis=-1))), None, None)


def test_contenders_take_turns() -> None:
    calls = []
    times = taken({"a": lambda: calls.append("a"), "b": lambda: calls.append("b")}, repeats=3)
    assert calls == ["a", "b"] * 4
    assert {name: len(some) for name, some in times.items()} == {"a": 3, "b": 3}
