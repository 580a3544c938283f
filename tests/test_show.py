"""What a person sees of a run, in a terminal and without one."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from rich.live import Live

from launcher import show
from launcher.record.ledger import Ledger
from launcher.record.metrics import Metrics, ended_because, run_metrics
from launcher.records import Plan
from launcher.run import Outcome
from tests.simulated import simulated, spcpf

STATUS: dict[str, Any] = {
    "t_s": 2.4,
    "sent": 90,
    "outcomes": {"delivered": 70, "late": 4, "ignored": 1, "radio": 9, "asleep": 6},
    "states": {"asleep": 100, "reporting": 4},
    "errors": {"imm-ukf": 1.234, "spcpf": None},
}

Said = Callable[[], str]


@pytest.fixture
def plan() -> Plan:
    return spcpf(1, ["target.steps=5"])


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> Said:
    """All that was said so far, to somebody without a terminal."""
    stream = io.StringIO()
    monkeypatch.setattr(show, "console", Console(file=stream, width=300, highlight=False))
    return stream.getvalue


# --- while it runs ----------------------------------------------------------------------------------------------------


def test_quiet_says_nothing(plan: Plan, said: Said, capfd: pytest.CaptureFixture[str]) -> None:
    with show.observing(plan, quiet=True) as observer:
        observer.starting({"n000"}, 122)
        observer.running({})
        observer.running(STATUS)
    assert said() == ""
    assert capfd.readouterr() == ("", "")


def test_lines_say_that_processes_start_and_now_and_then_who_is_missing(
    plan: Plan, said: Said, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = show.Lines(plan)
    nodes = {f"n{i:03}" for i in range(121)}
    for after_s, missing in ((0.0, nodes), (0.1, nodes), (show.PLAIN_EVERY_S, nodes - {"n003"}), (20.0, {"n120"})):
        monkeypatch.setattr(show.time, "monotonic", lambda at=1000.0 + after_s: at)
        lines.starting(missing, 122)
    assert said() == (
        "starting 122 processes ...\n"
        "2 of 122 ready, missing n000, n001, n002, n004, n005, ...\n"
        "121 of 122 ready, missing n120\n"
    )


def test_lines_wait_for_the_first_status(plan: Plan, said: Said) -> None:
    with show.observing(plan, quiet=False) as observer:
        observer.running({})
        observer.running({**STATUS, "t_s": 0.0})  # nothing has begun
        assert said() == ""
        observer.running(STATUS)
    assert said() == (
        "t = 2 s of 6: frames sent 90; delivered 75; lost (asleep) 6; lost (radio) 9; error: imm-ukf 1.23 m, spcpf -\n"
    )


def test_lines_come_only_so_often(plan: Plan, said: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    lines = show.Lines(plan)
    for after_s, told in ((0.0, 1), (show.PLAIN_EVERY_S - 0.1, 1), (show.PLAIN_EVERY_S, 2)):
        monkeypatch.setattr(show.time, "monotonic", lambda at=1000.0 + after_s: at)
        lines.running(STATUS)
        assert said().count("t = 2 s") == told


def test_a_status_of_a_run_that_has_just_begun_can_be_shown(plan: Plan, said: Said) -> None:
    bare = {"t_s": 0.1, "sent": 0, "outcomes": {}, "states": {}, "errors": {}}
    show.Lines(plan).running(bare)
    assert said() == "t = 0 s of 6: frames sent 0; delivered 0; error: -\n"
    with Live(console=show.console) as live:
        show.Screen(plan, live).running(bare)


def drawn(live: Live) -> str:
    console = Console(width=100)
    with console.capture() as text:
        console.print(live.renderable)
    return text.get()


def test_the_screen_counts_who_is_ready_and_then_shows_a_table(plan: Plan, said: Said) -> None:
    with Live(console=show.console) as live:
        screen = show.Screen(plan, live)
        screen.starting({"n000", "fusion"}, 122)
        assert drawn(live) == "starting processes: 120 of 122 ready, missing fusion, n000\n"
        screen.running({})  # no status yet: it stays
        assert drawn(live) == "starting processes: 120 of 122 ready, missing fusion, n000\n"
        screen.running(STATUS)
        table = drawn(live)
    assert "zhai-spcpf  t = 2 / 6 s" in table
    for cell in ("asleep 100", "reporting 4", "frames sent 90", "delivered 75", "lost (radio) 9", "imm-ukf 1.23 m"):
        assert cell in table


def test_a_terminal_gets_the_screen(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Console(file=io.StringIO(), force_terminal=True, width=100)
    monkeypatch.setattr(show, "console", terminal)
    with show.observing(plan, quiet=False) as observer:
        assert isinstance(observer, show.Screen)
        observer.running(STATUS)
    with show.observing(plan, quiet=True) as observer:
        assert isinstance(observer, show.Quiet)


# --- before and after -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("gaps", "told"),
    [
        ((), ()),
        (((0.5, 2.5),), ("2 of 5 steps lie in a gap of the recording (from 0.5 s for 2 s): ",)),
        (
            ((0.5, 1.5), (2.5, 4.75)),
            ("3 of 5 steps lie in 2 gaps of the recording (the longest from 2.5 s for 2 s): ",),
        ),
    ],
)
def test_a_plan_is_announced_with_its_gaps(
    plan: Plan, said: Said, gaps: tuple[tuple[float, float], ...], told: tuple[str, ...]
) -> None:
    show.announce(replace(plan, paths={"target": replace(plan.paths["target"], gaps=gaps)}))
    first, *notes = said().splitlines()
    assert first == "zhai-spcpf: 121 sensor nodes, 6 s, link lognormal_prr, seed 1, trackers imm-ukf, spcpf"
    after = "a straight line stands in for the truth there, and headline errors leave these steps out"
    assert notes == [f"note: {line}{after}" for line in told]


# --- in virtual time --------------------------------------------------------------------------------------------------


def test_a_long_virtual_run_says_now_and_then_how_far_it_is(
    plan: Plan, said: Said, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [1000.0]
    monkeypatch.setattr(show.time, "monotonic", lambda: now[0])
    with show.progress(plan, quiet=False) as tick:
        for after_s, t_s in ((1.0, 0.1), (9.9, 2.0), (10.0, 2.4), (15.0, 3.0), (20.0, 4.0), (30.0, None)):
            now[0] = 1000.0 + after_s
            tick(t_s)
    assert said() == "t = 2 s of 6; about 15 s left\nt = 4 s of 6; about 10 s left\n"


def test_a_terminal_gets_a_bar_with_the_emulated_time(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    file = io.StringIO()
    monkeypatch.setattr(show, "console", Console(file=file, force_terminal=True, width=100))
    with show.progress(plan, quiet=False) as tick:
        tick(2.4)
        tick(None)
    assert "zhai-spcpf" in file.getvalue()
    assert "t = 2 of 6 s" in file.getvalue()
    assert "writing tables and report" in file.getvalue()


def test_a_quiet_virtual_run_says_nothing(plan: Plan, said: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(show, "PLAIN_EVERY_S", 0.0)
    with show.progress(plan, quiet=True) as tick:
        tick(2.0)
    assert said() == ""


def metrics_of(plan: Plan) -> Metrics:
    return run_metrics(plan, *simulated(plan))


def outcome(metrics: Metrics, *complaints: str, signal: int | None = None) -> Outcome:
    return Outcome(Path("runs/a"), metrics, complaints, signal)


def rows(text: str) -> dict[str, list[str]]:
    """The cells of a table by the first of their row."""
    cells = [[cell.strip() for cell in line.strip("│").split("│")] for line in text.splitlines() if "│" in line]
    return {row[0]: row[1:] for row in cells}


def test_a_result_ends_with_folder_and_next_command(plan: Plan, said: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(show.shutil, "which", lambda name: f"/bin/{name}")
    metrics = metrics_of(plan)
    metrics["trackers"]["spcpf"] |= {
        "rmse": {"position": 1.234, "velocity": 5.678},
        "median_error": 0.999,
        "verdict": "lost",
    }
    metrics["frames"] |= {"sent": 20, "delivered": 15, "late": 2, "lost": {"radio": 4, "asleep": 0, "dead": 1}}
    show.conclude(outcome(metrics))
    table = rows(said())
    assert table["spcpf"] == ["1.23 m", "1.00 m", "5.68 m/s", "5 of 5", "lost"]
    assert table["imm-ukf"][-2:] == ["5 of 5", "tracked"]
    assert "frames: sent 20, delivered 15 (late 2); lost: radio 4, dead 1" in said()
    folder, page, following = said().splitlines()[-3:]
    assert (folder, page) == ("run folder: runs/a", "report: runs/a/report.html")
    assert following == "next: trackfield view runs/a"
    assert "failed" not in said()


def test_each_of_several_views_has_its_row(plan: Plan, said: Said) -> None:
    metrics = metrics_of(plan)
    figures = metrics["trackers"]["spcpf"]["views"]["base"]
    late = figures | {"median_error": 7.0, "steps_tracked": 4, "verdict": None, "rmse": dict.fromkeys(figures["rmse"])}
    metrics["trackers"]["spcpf"]["views"] = {"in-network": figures | {"median_error": 2.0}, "base": late}
    show.conclude(outcome(metrics))
    table = rows(said())
    assert "spcpf" not in table
    assert table["spcpf, in-network"][1:] == ["2.00 m", *table["spcpf, in-network"][2:4], "tracked"]
    assert table["spcpf, base"] == ["-", "7.00 m", "-", "4 of 5", "no truth to judge by"]


def test_leaders_slaves_and_the_age_of_what_is_known_have_a_line_each(plan: Plan, said: Said) -> None:
    metrics = metrics_of(plan)
    metrics["leaders"] |= {
        "per_step_mean": 1.02, "two_leader_steps": 1, "handovers": 12, "lost_handovers": 2, "take_overs": 1,
        "reports_used": 3.93, "reports_asked": 4.68,
    }  # fmt: skip
    metrics["clusters"] |= {"orphans_first": 3, "orphans_last": 0}
    metrics["age_of_information_s"] = {"mean": 4.0, "p95": 9.5}
    show.conclude(outcome(metrics))
    leaders = "12 hand-overs (2 more lost), 1 take-over (0 false), two at once in 1 step"
    assert f"leaders: {leaders}; 3.9 reports a step of 4.7 asked for\n" in said()
    assert "slaves without a master: 3 at the first step, 0 at the end\n" in said()
    assert "what the base knew was 4 s old, mean; 9.5 s, 95 %\n" in said()


def test_elections_are_named_where_there_are_any(plan: Plan, said: Said) -> None:
    metrics = metrics_of(plan)
    metrics["leaders"] |= {"per_step_mean": 1.0, "elections": 3, "split_elections": 1, "reports_used": 2.5}
    show.conclude(outcome(metrics))
    assert "0 take-overs (0 false), 3 elections (1 split), two at once in 0 steps; 2.5 reports a step\n" in said()


def test_a_folders_name_stays_whole_whatever_the_width(plan: Plan, said: Said, monkeypatch: pytest.MonkeyPatch) -> None:
    """The lines are there to be copied, or read by a script."""
    show.console.width = 60
    monkeypatch.setattr(show.shutil, "which", lambda name: f"/bin/{name}")
    folder = f"runs/{'long-' * 30}/[red] a b"
    show.conclude(replace(outcome(metrics_of(plan)), folder=Path(folder)))
    assert said().splitlines()[-3:] == [
        f"run folder: {folder}",
        f"report: {folder}/report.html",
        f"next: trackfield view '{folder}'",
    ]


def test_a_tracker_without_a_track_has_no_figures(said: Said) -> None:
    plan = spcpf(1, ["target.steps=5", "link.loss=1", "fusion.prior=none"])
    show.conclude(outcome(metrics_of(plan)))
    assert rows(said())["spcpf"] == ["-", "-", "-", "0 of 5", "lost"]
    assert " lost on the link): no tracker had any report\n" in said()


def test_figures_in_doubt_are_called_so(plan: Plan, said: Said) -> None:
    metrics = metrics_of(plan)
    metrics["timing"]["host_late"] = 3
    show.conclude(outcome(metrics))
    assert "3 events came too late on this machine" in said()
    assert "a machine with less to do, a lower --speed or --virtual is exact" in said()


def test_a_run_that_was_not_settled_and_devices_that_may_have_reacted_are_told(plan: Plan, said: Said) -> None:
    metrics = metrics_of(plan)
    metrics["timing"] |= {"unsettled": 2, "foreign_corrections": 4}
    show.conclude(outcome(metrics))
    assert "2 processes were not settled when the run was ended (timing.unsettled)" in said()
    assert "4 frames to foreign devices were taken back or replaced (timing.foreign_corrections)" in said()


def test_a_run_without_any_frame_says_so(plan: Plan, said: Said) -> None:
    show.conclude(outcome(run_metrics(plan, Ledger(plan.run, plan.processes), [])))
    assert "no frame was sent: no tracker had any report" in said()
    assert "none of" not in said()


def test_a_run_in_which_all_is_well_has_nothing_to_add(plan: Plan, said: Said) -> None:
    show.conclude(outcome(metrics_of(plan)))
    energy, after = said().partition("lost: none")[2].strip().splitlines()[:2]
    assert energy.startswith("energy from batteries: ")
    assert after.startswith("run folder: ")


def test_complaints_are_told_as_they_are_but_not_all(plan: Plan, said: Said) -> None:
    complaints = ["n017 died at 3.1 s: signal 9; its log ends:\n[/] [red]x[/red]", "n018 died", "n019 died", "a", "b"]
    show.conclude(outcome(metrics_of(plan), *complaints))
    for complaint in complaints[:3]:
        assert f"failed: {complaint}" in said()
    assert "failed: a" not in said()
    assert "... and 2 more (metrics.json has all)" in said()


def test_a_run_that_nobody_recorded_still_has_its_complaint(plan: Plan, said: Said) -> None:
    metrics = metrics_of(plan)
    metrics["trackers"] = dict.fromkeys(metrics["trackers"])
    metrics["frames"] = dict.fromkeys(metrics["frames"])
    metrics["timing"] = dict.fromkeys(metrics["timing"])
    show.conclude(outcome(metrics, "recorder died at 2.0 s: signal 9"))
    first, *_, folder, _, _ = said().splitlines()
    assert first == "failed: recorder died at 2.0 s: signal 9"
    assert folder == "run folder: runs/a"
    assert "no frame was sent" not in said()


def test_an_early_end_is_told(plan: Plan, said: Said) -> None:
    show.conclude(outcome(metrics_of(plan) | ended_because("interrupted (SIGINT)"), signal=2))
    assert "ended early; everything up to then is in the run folder" in said()
    show.conclude(outcome(metrics_of(plan), signal=2))
    assert "interrupted after its end; the run is complete" in said()


def test_without_a_program_on_the_path_the_next_command_names_this_one(
    plan: Plan, said: Said, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(show.shutil, "which", lambda name: None)
    monkeypatch.setattr("sys.argv", [str(tmp_path / ".venv/bin/trackfield"), "run"])
    show.conclude(outcome(metrics_of(plan)))
    assert said().endswith("next: .venv/bin/trackfield view runs/a\n")
