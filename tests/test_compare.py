"""Comparing run folders: every difference is found, and none where there is none."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from rich.console import Console

from launcher.plan.prepare import load, planned
from launcher.record.folder import keep
from launcher.record.journal import write_json
from launcher.record.metrics import run_metrics
from launcher.record.reading.files import check_run
from launcher.record.tables import TrackRow, write_messages, write_tracks
from launcher.records import MessageRow
from launcher.study.compare import differences
from launcher.study.comparison.remarks import remarks
from launcher.study.comparison.rows import Row
from launcher.study.comparison.runs import read_runs
from launcher.study.side_by_side import side_by_side
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


def finished(
    at: Path, *settings: str, steps: int = 5, change: Callable[[dict[str, Any]], object] = lambda metrics: None
) -> Path:
    """The folder of a real run of a few steps."""
    scenario = load("spcpf", seed=1, settings=[f"target.steps={steps}", *settings])
    plan = planned(scenario)
    ledger, tracks = simulated(plan)
    metrics = run_metrics(plan, ledger, tracks) | {
        "driver": "virtual",
        "wall_s": 1.0,
        "recorder": {"messages": len(ledger.rows), "dropped": 0, "complaints": []},
    }
    change(metrics)
    write_json(metrics, folder(at, tracks, ledger.rows) / "metrics.json")
    keep(scenario, at)
    return at


def shown(*runs: Path) -> dict[str, dict[str, list[str]]]:
    """What the table says: the cells of each row, by the titles of groups and the names of rows."""
    console = Console(width=200)
    with console.capture() as said:
        console.print(side_by_side(read_runs(runs)))
    rows = [[cell.strip() for cell in line.strip("│").split("│")] for line in said.get().splitlines() if "│" in line]
    found: dict[str, dict[str, list[str]]] = {}
    for name, *cells in rows:
        if any(cells):
            found[title][name] = cells  # noqa: F821
        else:
            title = name
            found[title] = {}
    return found


def known(name: str = "spcpf", **figures: Any) -> Callable[[dict[str, Any]], object]:
    """Metrics in which a tracker has these figures; an RMSE is given as ``rmse_m``."""

    def change(metrics: dict[str, Any]) -> None:
        if "rmse_m" in figures:
            metrics["trackers"][name]["rmse"]["position"] = figures.pop("rmse_m")
        metrics["trackers"][name] |= figures

    return change


def test_figures_stand_side_by_side(tmp_path: Path) -> None:
    def odd(metrics: dict[str, Any]) -> None:
        known(rmse_m=1.25, verdict="tracked with gaps", steps_tracked=3, longest_blackout_s=2.0)(metrics)
        metrics["timing"]["host_late"] = 17

    a = finished(tmp_path / "a", change=odd)
    b = finished(tmp_path / "b", "link.loss=1", 'fusion.trackers=["imm-ukf"]')
    table = shown(a, b)
    assert table["spcpf"]["RMSE [m]"] == ["1.25", "–"]
    assert table["spcpf"]["verdict"] == ["tracked with gaps", "–"]
    assert table["spcpf"]["steps with a track"] == ["3 of 5", "–"]
    assert table["spcpf"]["longest time without a track [s]"] == ["2.00", "–"]
    assert table["machine"]["events out of order (host late)"] == ["17", "0"]
    frames = table["frames"]
    assert frames["delivered"][1] == "0"
    assert frames["lost"][1] == frames["expected"][1] == frames["sent"][1] != "0"
    assert (frames["lost"][0], frames["share lost"]) == ("0", ["0.0 %", "100.0 %"])


def test_the_keys_in_which_scenarios_differ_come_first(tmp_path: Path) -> None:
    many = "faults=[{kind='deaf', nodes=['n000', 'n001', 'n002', 'n003', 'n004'], at_s=1}%s]"
    a = finished(tmp_path / "a", "link.busy=0.25", many % "")
    b = finished(tmp_path / "b", many % ", {kind='deaf', nodes=['n005'], at_s=1}")
    c = finished(tmp_path / "c", "link.model=ideal")
    title, first = next(iter(shown(a, b, c).items()))
    assert title == "settings that differ"
    assert first["link.busy"] == ["0.25", "0.0", "–"]
    assert first["link.model"] == ["lognormal_prr", "lognormal_prr", "ideal"]
    assert first["faults"][2] == "–"
    assert first["faults"][0].endswith(" ...")  # what tells them apart is too long to be shown
    assert "name" not in first
    assert "link.queue" not in shown(a, b)["settings that differ"]
    assert next(iter(shown(a, finished(tmp_path / "again", "link.busy=0.25", many % "")))) == "imm-ukf"


def test_only_what_says_something_has_a_row(tmp_path: Path) -> None:
    a, b = finished(tmp_path / "a", "link.model=ideal"), finished(tmp_path / "b", "link.model=fixed", "link.loss=0.5")
    table = shown(a, b)
    lost = int(table["frames"]["lost"][1])
    assert table["frames"]["lost: radio"] == ["0", str(lost)]
    assert lost > 0
    said = {row for group in table.values() for row in group}
    nothing = {
        "lost: partition",
        "lost: overflow",
        "lost by the machine",
        "on the air [bytes]",
        "clock error, rms [ms]",
    }
    assert not said & {*nothing, "driver", "RMSE in gaps of the truth [m]"}
    for group, row in (
        ("spcpf", "mean NEES"),
        ("spcpf", "RMSE / bound"),
        ("bound", "with the reports of the run [m]"),
        ("network and energy", "on the link, 95 % [ms]"),
        ("network and energy", "energy [J]"),
    ):
        assert all(float(cell) > 0 for cell in table[group][row])


def test_an_error_is_measured_by_the_bound_of_its_own_run(tmp_path: Path) -> None:
    a = finished(tmp_path / "a", change=known(times_bound=2.0, nees_band=[2.5, 5.5]))
    b = finished(tmp_path / "b", change=known(times_bound=0.75, nees_band=None))
    table = shown(a, b)["spcpf"]
    assert table["RMSE / bound"] == ["2.00", "0.75"]
    assert table["NEES, 95 % band"] == ["2.50 to 5.50", "–"]


@pytest.mark.parametrize(
    ("cells", "better", "best"),
    [
        ((3.0, 2.0, None), "lower", (False, True, False)),
        ((3.0, 2.0, None), "higher", (True, False, False)),
        ((2, 2, 3), "lower", (True, True, False)),
        ((2, 2), "lower", (False, False)),
        ((2.001, 2.002), "lower", (False, False)),  # they read alike
        ((None, 2.0), "lower", (False, False)),
        ((1.0, 2.0), None, (False, False)),
        (("yes", "no"), "lower", (False, False)),
    ],
)
def test_the_best_figure_of_a_row(cells: tuple[Any, ...], better: Any, best: tuple[bool, ...]) -> None:
    assert Row("x", cells, better).best == best


def test_only_fair_figures_can_be_the_best() -> None:
    assert Row("x", (1.0, 2.0, 3.0), "lower", judged=(False, True, True)).best == (False, True, False)
    assert Row("x", (1.0, 2.0), "lower", judged=(False, True)).best == (False, False)


def bold(row: str, *runs: Path) -> list[str]:
    """The cells of the first row of this name that stand out."""
    console = Console(width=200, force_terminal=True, color_system="standard")
    with console.capture() as said:
        console.print(side_by_side(read_runs(runs)))
    line = next(line for line in said.get().splitlines() if row in line)
    return re.findall(r"\x1b\[1m +([\d.]+)", line)


def test_the_best_figure_stands_out_unless_its_track_was_lost(tmp_path: Path) -> None:
    alone = 'fusion.trackers=["spcpf"]'
    a = finished(tmp_path / "a", alone, change=known(rmse_m=1.25, verdict="tracked"))
    b = finished(tmp_path / "b", alone, change=known(rmse_m=1.75, verdict="tracked"))
    c = finished(tmp_path / "c", alone, change=known(rmse_m=0.5, verdict="lost"))
    assert bold(" RMSE [m]", b, a) == bold(" RMSE [m]", c, b, a) == ["1.25"]
    assert bold(" RMSE [m]", a, c) == []


# --- remarks ----------------------------------------------------------------------------------------------------------


def test_one_seed_proves_nothing_and_the_remark_names_the_study_that_does(tmp_path: Path) -> None:
    a, b = finished(tmp_path / "a"), finished(tmp_path / "b", "sensor.doa_sd_deg=5")
    (remark,) = remarks(read_runs([a, b]))
    assert "one draw of the random numbers (seed 1): a lower figure may be chance" in remark
    study = f"trackfield study {a}/scenario.toml --seeds 20 --vary sensor.doa_sd_deg=3.0,5.0"
    assert f"`{study}` gives confidence intervals" in remark
    both = finished(tmp_path / "both", "sensor.doa_sd_deg=5", "link.busy=0.1")
    assert "--vary KEY=A,B`" in remarks(read_runs([a, both]))[0]


def test_of_the_same_scenario_and_seed_nothing_is_chance(tmp_path: Path) -> None:
    a, b = finished(tmp_path / "a"), finished(tmp_path / "b")
    (remark,) = remarks(read_runs([a, b]))
    assert remark.startswith("All runs have the same scenario and seed")
    assert "--exact 0" in remark


def test_runs_of_other_paths_and_lengths_are_compared_in_what_can_be(tmp_path: Path) -> None:
    a, b = finished(tmp_path / "a"), finished(tmp_path / "b", "target.path=s2", steps=4)
    _, paths, lengths = remarks(read_runs([a, b]))
    assert "different paths" in paths
    assert "a 5 s, b 4 s" in lengths
    for row in (" RMSE [m]", "median error [m]", "payload [bytes]", "energy [J]"):
        assert bold(row, a, b) == []
    shorter = finished(tmp_path / "c", steps=4)
    assert not any("different paths" in remark for remark in remarks(read_runs([a, shorter])))


# --- folders ----------------------------------------------------------------------------------------------------------


def test_runs_are_named_by_their_folders_and_as_many_parents_as_it_takes(tmp_path: Path) -> None:
    for parent in ("x", "y"):
        (tmp_path / parent).mkdir()
    same = [finished(tmp_path / parent / "a") for parent in ("x", "y")]
    assert read_runs(same).names == ("x/a", "y/a")
    assert read_runs([same[0], finished(tmp_path / "b")]).names == ("a", "b")


def test_a_run_is_not_compared_with_itself(tmp_path: Path) -> None:
    a = finished(tmp_path / "a")
    (tmp_path / "other").symlink_to(a)
    for again, what in (
        (a, f"{a} is named twice"),
        (tmp_path / "other", f"{tmp_path / 'other'} is the same run as {a}"),
    ):
        with pytest.raises(ScenarioError) as failure:
            read_runs([a, again])
        assert (failure.value.what, failure.value.expected) == (what, "different runs")


def test_as_many_runs_as_one_likes(tmp_path: Path) -> None:
    runs = [finished(tmp_path / name) for name in "abcd"]
    assert len(shown(*runs)["frames"]["sent"]) == 4


def test_what_is_no_run_is_named(tmp_path: Path) -> None:
    a = finished(tmp_path / "a")
    check_run(a)
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
            check_run(broken)
        assert (failure.value.file, failure.value.what) == (str(broken), what)


def test_a_run_of_an_older_version_is_named(tmp_path: Path) -> None:
    a, figures, columns = finished(tmp_path / "a"), tmp_path / "figures", tmp_path / "columns"
    finished(figures, change=lambda metrics: metrics["trackers"]["spcpf"].pop("verdict"))
    tracks = finished(columns) / "tracks.parquet"
    pq.write_table(pq.read_table(tracks).drop_columns("true_interpolated"), tracks)
    for old, file, key, what in (
        (figures, "metrics.json", "trackers.spcpf.verdict", "is missing"),
        (columns, "tracks.parquet", "", "was written by an older version"),
    ):
        with pytest.raises(ScenarioError) as failure:
            read_runs([a, old])
        assert (failure.value.file, failure.value.key, failure.value.what) == (str(old / file), key, what)
