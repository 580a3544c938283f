"""Comparing run folders: every difference is found, and none where there is none."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from launcher.plan.prepare import load, planned
from launcher.record.folder import keep
from launcher.record.journal import write_json
from launcher.record.metrics import run_metrics
from launcher.record.tables import TrackRow, write_messages, write_tracks
from launcher.records import MessageRow
from launcher.study.compare import check_runs, differences
from launcher.study.side_by_side import Row, side_by_side
from tests.simulated import simulated
from trackfield.errors import ScenarioError
from trackfield.role import NS, TrackPoint

COVARIANCE = tuple(float(i) for i in range(16))
REPORTS = ("n0", "n1")
TRACKS = [
    TrackRow(NS, TrackPoint("t", "target", NS, "waiting", step=1)),
    *(
        TrackRow(
            t, TrackPoint("t", "target", t, "tracking", (t / NS, 2.0, 3.0, 4.0), COVARIANCE, REPORTS, step=t // NS)
        )
        for t in (2 * NS, 3 * NS, 4 * NS)
    ),
]
FRAMES = [MessageRow("doa", "n0", "fusion", "field", n * NS, n * NS + 1, "delivered", 12) for n in (1, 2, 3)]


def folder(at: Path, tracks: Sequence[TrackRow] = TRACKS, frames: Sequence[MessageRow] = FRAMES) -> Path:
    at.mkdir()
    write_tracks(tracks, {}, at / "tracks.parquet")
    write_messages(frames, at / "messages.parquet")
    return at


def with_point(index: int, **changes: Any) -> list[TrackRow]:
    rows = list(TRACKS)
    rows[index] = replace(rows[index], point=replace(rows[index].point, **changes))
    return rows


def with_frame(index: int, **changes: Any) -> list[MessageRow]:
    rows = list(FRAMES)
    rows[index] = replace(rows[index], **changes)
    return rows


def test_a_run_equals_itself_and_its_copy(tmp_path: Path) -> None:
    a, b = folder(tmp_path / "a"), folder(tmp_path / "b")
    assert differences(a, a, 0.0) == differences(a, b, 0.0) == []


def test_runs_in_which_nothing_happened_are_equal(tmp_path: Path) -> None:
    assert differences(folder(tmp_path / "a", [], []), folder(tmp_path / "b", [], []), 0.0) == []


@pytest.mark.parametrize(("at", "name"), list(enumerate(("x", "y", "vx", "vy"))))
def test_a_point_that_moved_is_found_unless_the_tolerance_covers_it(tmp_path: Path, at: int, name: str) -> None:
    mean = [3.0, 2.0, 3.0, 4.0]
    mean[at] += 1e-6
    a, b = folder(tmp_path / "a"), folder(tmp_path / "b", with_point(2, mean=tuple(mean)))
    for one, other in ((a, b), (b, a)):
        assert differences(one, other, 0.0) == [f"tracks: {name} differs by up to 1e-06"]
        assert differences(one, other, 0.9e-6) == [f"tracks: {name} differs by up to 1e-06"]
        assert differences(one, other, 1.1e-6) == []


def test_the_last_bit_counts_where_the_tolerance_is_zero(tmp_path: Path) -> None:
    a, b = folder(tmp_path / "a"), folder(tmp_path / "b", with_point(2, mean=(3.0000000000000004, 2.0, 3.0, 4.0)))
    assert differences(a, b, 0.0) == ["tracks: x differs by up to 4.44e-16"]


def test_a_tolerance_is_absolute(tmp_path: Path) -> None:
    far = [with_point(2, mean=(1e6 + d, 2.0, 3.0, 4.0)) for d in (0.0, 0.1)]
    a, b = folder(tmp_path / "a", far[0]), folder(tmp_path / "b", far[1])
    assert differences(a, b, 0.2) == []
    assert len(differences(a, b, 0.05)) == 1


def test_another_covariance_is_found(tmp_path: Path) -> None:
    a, b = folder(tmp_path / "a"), folder(tmp_path / "b", with_point(3, covariance=(0.5, *COVARIANCE[1:])))
    assert differences(a, b, 0.1) == ["tracks: covariance differs by up to 0.5"]
    c = folder(tmp_path / "c", with_point(3, covariance=()))
    assert differences(a, c, 0.1) == ["tracks: covariance is there for other steps"]


@pytest.mark.parametrize(
    "other",
    [
        TRACKS[:-1],
        TRACKS[1:],
        with_point(2, step=9),
        with_point(2, status="coasting"),
        with_point(2, sensors=("n0", "n2")),
        with_point(2, source="other"),
        with_point(2, at_ns=5),
        with_point(2, tracker="u"),
        with_point(2, target="other"),
        [],
    ],
)
def test_other_steps_states_or_reports_are_found(tmp_path: Path, other: list[TrackRow]) -> None:
    a, b = folder(tmp_path / "a"), folder(tmp_path / "b", other)
    (what,) = differences(a, b, 1e9)
    assert what == f"the tracks have other steps, states or numbers of reports (4 and {len(other)} points)"


@pytest.mark.parametrize(
    "other",
    [
        with_frame(1, outcome="radio", due_ns=None),
        with_frame(1, outcome="late"),
        with_frame(1, due_ns=2 * NS + 2),
        with_frame(1, bytes=13),
        with_frame(1, copy=1),
        with_frame(1, incarnation=1),
    ],
)
def test_another_fate_of_one_frame_is_found_and_named(tmp_path: Path, other: list[MessageRow]) -> None:
    a, b = folder(tmp_path / "a"), folder(tmp_path / "b", frames=other)
    assert differences(a, b, 1e9) == [
        "frames: 1 only in the first run, 1 only in the second; the first doa from n0 to fusion at 2.000 s"
    ]


def test_a_frame_too_few_or_too_many_is_found(tmp_path: Path) -> None:
    a, b = folder(tmp_path / "a"), folder(tmp_path / "b", frames=FRAMES[:2])
    assert differences(a, b, 0.0)[0].startswith("frames: 1 only in the first run, 0 only in the second")
    assert differences(b, a, 0.0)[0].startswith("frames: 0 only in the first run, 1 only in the second")


def test_tracks_and_frames_are_told_together(tmp_path: Path) -> None:
    a = folder(tmp_path / "a")
    b = folder(tmp_path / "b", with_point(1, mean=(9.0, 9.0, 3.0, 4.0)), FRAMES[:2])
    assert [what.partition(":")[0] for what in differences(a, b, 0.0)] == ["tracks", "tracks", "frames"]


# --- side by side -----------------------------------------------------------------------------------------------------


def finished(at: Path, *settings: str, change: Callable[[dict[str, Any]], object] = lambda metrics: None) -> Path:
    """The folder of a real run of a few steps."""
    scenario = load("spcpf", seed=1, settings=["target.steps=5", *settings])
    plan = planned(scenario)
    ledger, tracks = simulated(plan)
    metrics = run_metrics(plan, ledger, tracks)
    change(metrics)
    write_json(metrics, folder(at, tracks, ledger.rows) / "metrics.json")
    keep(scenario, at)
    return at


def shown(*runs: Path) -> dict[str, list[str]]:
    console = Console(width=200, markup=False)
    with console.capture() as said:
        console.print(side_by_side(runs))
    rows = [[cell.strip() for cell in line.strip("│").split("│")] for line in said.get().splitlines() if "│" in line]
    return {row[0]: row[1:] for row in rows}


def test_figures_stand_side_by_side(tmp_path: Path) -> None:
    def known(metrics: dict[str, Any]) -> None:
        metrics["trackers"]["spcpf"]["rmse"]["position"] = 1.25
        metrics["trackers"]["spcpf"]["verdict"] = "tracked with gaps"
        metrics["timing"]["host_late"] = 17

    a = finished(tmp_path / "a", change=known)
    b = finished(tmp_path / "b", "link.loss=1", 'fusion.trackers=["fix-imm-ukf"]')
    table = shown(a, b)
    assert table["spcpf RMSE [m]"] == ["1.250", "-"]
    assert table["spcpf verdict"] == ["tracked with gaps", "-"]
    assert table["host late"] == ["17", "0"]
    assert table["frames delivered"][1] == "0"
    assert table["frames lost"][1] == table["frames expected"][1] == table["frames sent"][1] != "0"
    assert table["frames lost"][0] == "0"


def test_the_keys_in_which_scenarios_differ_come_first(tmp_path: Path) -> None:
    many = "faults=[{kind='deaf', nodes=['n000', 'n001', 'n002', 'n003', 'n004'], at_s=1}%s]"
    a = finished(tmp_path / "a", "link.busy=0.25", many % "")
    b = finished(tmp_path / "b", many % ", {kind='deaf', nodes=['n005'], at_s=1}")
    c = finished(tmp_path / "c", "link.model=ideal")
    table = shown(a, b, c)
    assert {"link.model", "link.busy", "faults"} <= set(itertools.takewhile(lambda row: "RMSE" not in row, table))
    assert table["link.busy"] == ["0.25", "0.0", "-"]
    assert table["link.model"] == ["lognormal_prr", "lognormal_prr", "ideal"]
    assert table["faults"][2] == "-"
    assert table["faults"][0].endswith(" ...")  # what tells them apart is too long to be shown
    assert "name" not in table
    assert "link.queue" not in shown(a, b)
    assert next(iter(shown(a, a))) == "fix-imm-ukf RMSE [m]"


def test_only_what_says_something_has_a_row(tmp_path: Path) -> None:
    a, b = finished(tmp_path / "a", "link.model=ideal"), finished(tmp_path / "b", "link.model=fixed", "link.loss=0.5")
    table = shown(a, b)
    lost = int(table["frames lost"][1])
    assert table["radio"] == ["0", str(lost)]
    assert lost > 0
    for row in (
        "partition",
        "overflow",
        "frames lost by the machine",
        "on the air [bytes]",
        "clock error, rms [ms]",
        "driver",
    ):
        assert row not in table
    for row in (
        "spcpf NEES",
        "spcpf RMSE / bound",
        "bound of these reports [m]",
        "on the link, 95 % [ms]",
        "energy [J]",
    ):
        assert all(float(cell) > 0 for cell in table[row])


def test_an_error_is_measured_by_the_bound_of_its_own_run(tmp_path: Path) -> None:
    def known(bound: float) -> Callable[[dict[str, Any]], object]:
        def change(metrics: dict[str, Any]) -> None:
            metrics["trackers"]["spcpf"]["rmse"]["position"] = 3.0
            metrics["trackers"]["spcpf"]["nees_band"] = [2.5, 5.5]
            metrics["bound"]["trajectory"] = bound

        return change

    a, b = finished(tmp_path / "a", change=known(1.5)), finished(tmp_path / "b", change=known(4.0))
    assert shown(a, b)["spcpf RMSE / bound"] == ["2.000", "0.750"]
    assert shown(a, b)["spcpf NEES, 95 % band"] == ["2.500 to 5.500"] * 2


@pytest.mark.parametrize(
    ("cells", "least", "best"),
    [((3.0, 2.0, None), True, 2.0), ((2, 2), True, None), ((None, 2.0), True, None), ((1.0, 2.0), False, None),
     (("yes", "no"), True, None)],
)  # fmt: skip
def test_the_best_figure_of_a_row(cells: tuple[float | str | None, ...], least: bool, best: float | None) -> None:
    assert Row("x", cells, least).best == best


def test_the_best_figure_stands_out(tmp_path: Path) -> None:
    a = finished(tmp_path / "a", change=lambda metrics: metrics["trackers"]["spcpf"]["rmse"].update(position=1.25))
    b = finished(tmp_path / "b", change=lambda metrics: metrics["trackers"]["spcpf"]["rmse"].update(position=1.75))
    console = Console(width=200, force_terminal=True, color_system="standard", markup=False)
    with console.capture() as said:
        console.print(side_by_side([b, a]))
    (line,) = [line for line in said.get().splitlines() if "spcpf RMSE [m]" in line]
    assert re.findall(r"\x1b\[1;32m +([\d.]+)", line) == ["1.250"]


def test_as_many_runs_as_one_likes(tmp_path: Path) -> None:
    a = finished(tmp_path / "a")
    assert len(shown(a, a, a, a)["frames sent"]) == 4


def test_what_is_no_run_is_named(tmp_path: Path) -> None:
    a = finished(tmp_path / "a")
    check_runs([a, a])
    for name, content, what in (
        ("metrics.json", b"{", "its metrics.json is damaged"),
        ("tracks.parquet", b"PAR1", "its tracks.parquet is damaged"),
        ("messages.parquet", None, "has no messages.parquet"),
        ("scenario.toml", b"[link", "its scenario.toml is damaged"),
    ):
        broken = finished(tmp_path / name)
        if content is None:
            (broken / name).unlink()
        else:
            (broken / name).write_bytes(content)
        with pytest.raises(ScenarioError) as failure:
            check_runs([a, broken])
        assert (failure.value.file, failure.value.what) == (str(broken), what)
