"""A short form of the campaign of chaos, and that it finds what is wrong."""

from __future__ import annotations

import signal
from dataclasses import replace
from pathlib import Path

import pytest

from tests.chaos import __main__ as chaos
from tests.chaos.deeds import DISK, LAUNCHER, OTHERS, SIGNALS, Case, Deed, Done, Phase, case_of
from tests.chaos.verdicts import Aftermath, complaints

MID_S = 2.0
"""After the first frame; the run lasts for twice as long."""


@pytest.mark.parametrize(
    "deed",
    [
        Deed(MID_S, "recorder", signal.SIGKILL, running=True),
        Deed(MID_S, LAUNCHER, signal.SIGKILL, running=True),
        pytest.param(Deed(MID_S, LAUNCHER, signal.SIGHUP, running=True), marks=pytest.mark.long),
        pytest.param(Deed(MID_S, "zygote", signal.SIGSTOP, 5.0, running=True), marks=pytest.mark.long),
        pytest.param(Deed(MID_S, DISK, 0, 1.0, running=True), marks=pytest.mark.long),
    ],
    ids=str,
)
def test_what_was_recorded_is_there_and_nothing_else_is_left(deed: Deed, tmp_path: Path) -> None:
    after, wrong = chaos.aftermath(case_of(3, deed), tmp_path)
    assert wrong == [], after.said
    assert [one.deed for one in after.done] == [deed] or deed.whom == DISK


# --- what is drawn ----------------------------------------------------------------------------------------------------


def test_all_that_can_be_drawn_is_drawn() -> None:
    deeds = [deed for seed in range(1, 301) for deed in Case(seed).deeds]
    assert {deed.whom for deed in deeds} == {LAUNCHER, DISK, *OTHERS}
    assert {deed.number for deed in deeds if deed.whom == LAUNCHER} >= {*SIGNALS, signal.SIGKILL, signal.SIGQUIT}
    assert {deed.whom for deed in deeds if deed.number == signal.SIGSTOP} == {LAUNCHER, *OTHERS}
    assert {len(Case(seed).deeds) for seed in range(1, 301)} == {1, 2, 3, 5}


def test_a_seed_draws_the_same_again() -> None:
    assert (Case(7).deeds, Case(7).settings) == (Case(7).deeds, Case(7).settings)
    assert Case(7).deeds != Case(8).deeds


# --- what it would find -----------------------------------------------------------------------------------------------


def after(folder: Path, code: int | None, *done: Done, said: str = "") -> Aftermath:
    return Aftermath(Case(1), folder, code, said, done, 9.0)


def killed(whom: str, phase: Phase = Phase.RUNNING) -> Done:
    return Done(Deed(5.0, whom, signal.SIGKILL), whom, phase, 10**9)


def first(found: Aftermath) -> str:
    return next(complaints(found))


def test_what_does_not_hold_is_told(tmp_path: Path) -> None:
    assert first(after(tmp_path, None)).startswith("does not end: 9 s")
    assert first(after(tmp_path, 0, killed("fusion"))).startswith("exit code 0, expected [1]")
    assert first(after(tmp_path, 1, killed(LAUNCHER))).startswith("exit code 1, expected [-9]")
    assert first(after(tmp_path, 2, killed("fusion", Phase.CLOSING))).startswith("exit code 2, expected [0, 1]")
    assert first(after(tmp_path, 0, said="Traceback (most recent")).startswith("a traceback in stderr")
    assert first(after(tmp_path, 0)) == "there is no run folder"
    assert first(replace(after(tmp_path, 0), left=("left behind: trackfield node n1",))).startswith("left behind")
    (tmp_path / "manifest.json").write_text("{}")
    assert first(after(tmp_path, 0)).startswith("neither figures nor a log")
    (tmp_path / "metrics.json").write_text(
        '{"frames": {"expected": 2, "delivered": 1, "lost": {}, "host_lost": 0, "host_late": 0}}'
    )
    assert first(after(tmp_path, 0)).startswith("the ledger does not close")


def test_a_failing_seed_is_told_as_the_command_that_repeats_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(seed: int) -> tuple[list[str], list[Done]]:
        return (["the sky fell"] if seed == 5 else []), [killed("fusion")]

    monkeypatch.setattr(chaos, "failures", broken)
    said: list[str] = []
    assert chaos.campaign(range(1, 11), said.append) == 1
    assert said[0] == "seed 5 fails: python -m tests.chaos --runs 1 --seed 5"
    assert said[2] == "  the sky fell"
    assert said[-2] == "| fusion SIGKILL | 0 | 10 | 0 |"
    assert said[-1].endswith(": 1 failed")
