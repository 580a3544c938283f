"""A short form of the campaign of faults, and that it finds what is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import pytest

from launcher.record.figures.hops import REPORTS
from tests.campaign import __main__ as campaign
from tests.campaign import verdicts
from tests.campaign.__main__ import Verdict
from tests.campaign.cases import FIELD, TALKERS, Case, case
from tests.campaign.census import PROVOKED, RETRACTION
from tests.campaign.draws import LINKS, Draw
from tests.campaign.fields import KINDS, SENSING, settings
from tests.campaign.verdicts import Run, complaints, run
from tests.protocols.agreement import Compared
from trackfield.role import NS

SEEDS = range(1, 31)
SOUND = 3
judged = cache(campaign.judged)
"""Each seed is run once for all tests that look at the same verdicts."""


def test_small_runs_under_everything_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign, "judged", judged)
    said: list[str] = []
    assert campaign.campaign(SEEDS, processes=0, say=said.append) == 0, "\n".join(said)


def test_all_that_can_be_drawn_is_drawn() -> None:
    cases = [case(seed) for seed in SEEDS]
    assert {one.talkers for one in cases} == set(TALKERS)
    fields = [settings(seed) for seed in SEEDS]
    assert {fault["kind"] for one in fields for fault in one["faults"]} == set(KINDS)
    assert {one["link.model"] for one in fields} == {LINKS[name](Draw(1))["model"] for name in LINKS}
    assert {one["sensor.kind"] for one in fields} == set(SENSING)
    assert {1, 2, 3, 4, 5, 6} == {len(one["faults"]) for one in fields}
    befallen = {id for one in fields for fault in one["faults"] for id in fault.get("nodes", ())}
    assert "fusion" in befallen


def test_a_seed_draws_the_same_again() -> None:
    for seed in (7, 8, 9):
        again = replace(Case(seed).plan.run, run=case(seed).plan.run.run)
        assert (again, Case(seed).plan.processes) == (case(seed).plan.run, case(seed).plan.processes)
    assert Case(7).plan.processes != Case(8).plan.processes


@pytest.mark.alone
@pytest.mark.parametrize("talkers", TALKERS)
def test_both_drivers_agree_on_one(talkers: str) -> None:
    seed = next(seed for seed in SEEDS if case(seed).talkers == talkers)
    assert campaign.judged(seed, processes=True).wrong == []


# --- what it would find -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sound() -> Run:
    """A run in which nothing is wrong, with reports and a track."""
    assert case(SOUND).talkers == FIELD
    found = run(case(SOUND).plan)
    assert list(complaints(found)) == []
    assert any(row.kind in REPORTS and row.delivered for row in found.ledger.rows)
    assert any(row.point.mean for row in found.tracks)
    return found


def again(sound: Run) -> Run:
    """The same run anew, to be spoilt."""
    return run(sound.plan)


def test_a_frame_too_many(sound: Run) -> None:
    spoilt = again(sound)
    spoilt.ledger.rows.append(next(row for row in spoilt.ledger.rows if row.delivered))
    assert any("processes counted" in what for what in complaints(spoilt))


def test_a_sum_that_is_wrong(sound: Run) -> None:
    frames = {**sound.metrics["frames"], "expected": sound.metrics["frames"]["expected"] + 1}
    spoilt = replace(sound, metrics={**sound.metrics, "frames": frames})
    assert any("does not close" in what for what in complaints(spoilt))


def test_a_step_reported_twice(sound: Run) -> None:
    spoilt = again(sound)
    row = next(row for row in spoilt.ledger.rows if row.kind in REPORTS)
    spoilt.ledger.rows.append(replace(row, sent_ns=row.sent_ns + 5))
    assert any(f"reports step {row.step} 2 times" in what for what in complaints(spoilt))


def test_a_track_that_is_no_number(sound: Run) -> None:
    i = next(i for i, row in enumerate(sound.tracks) if row.point.mean)
    point = replace(sound.tracks[i].point, mean=(1.0, float("nan"), 0.0, 0.0))
    spoilt = replace(sound, tracks=[*sound.tracks[:i], replace(sound.tracks[i], point=point)])
    assert any("is no number" in what for what in complaints(spoilt))


def test_a_life_after_death_and_a_stir_in_the_frost(sound: Run) -> None:
    spoilt = again(sound)
    row = next(row for row in spoilt.ledger.rows if row.kind in REPORTS and not row.incarnation)
    diary = spoilt.ledger.diaries[row.src]
    diary.spec = replace(diary.spec, kill_ns=row.sent_ns)
    assert any(f"{row.src} acts at" in what and "outside" in what for what in complaints(spoilt))
    diary.spec = replace(diary.spec, kill_ns=None, freezes=((row.sent_ns, row.sent_ns + NS),))
    assert any(f"{row.src} acts at" in what and "frozen" in what for what in complaints(spoilt))


def test_a_run_without_end(sound: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verdicts, "MAX_EVENTS", 10)
    assert any("does not end" in what for what in complaints(run(sound.plan)))


def test_a_frame_after_the_battery_was_empty(sound: Run) -> None:
    spoilt = again(sound)
    row = next(row for row in spoilt.ledger.rows if row.kind in REPORTS and not row.incarnation)
    spoilt.ledger.diaries[row.src].died = (row.sent_ns - 1, 3)
    assert any(f"{row.src} acts at" in what and "battery" in what for what in complaints(spoilt))


# --- what a campaign says ---------------------------------------------------------------------------------------------


def judging(**wrong: list[str]) -> Callable[..., Verdict]:
    """Judges that find this wrong with some seeds; in every third one something happened."""
    return lambda seed, processes: Verdict(wrong.get(f"seed{seed}", []), {"a kill"} if seed % 3 == 0 else set())


def test_a_failing_seed_is_told_as_the_command_that_repeats_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign, "judged", judging(seed5=["the sky fell"]))
    said: list[str] = []
    assert campaign.campaign(range(1, 11), processes=2, say=said.append) == 1
    assert said[:2] == [
        "seed 5 fails: python -m tests.campaign --runs 1 --seed 5 --processes 0",
        "  the sky fell",
    ]
    assert said[-1].endswith(": 1 failed")


def test_an_exception_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(plan: object) -> Run:
        raise ZeroDivisionError

    monkeypatch.setattr(campaign, "run", broken)
    assert "ZeroDivisionError" in campaign.judged(1, processes=False).wrong[0]


def test_what_never_happened_is_a_failure(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign, "judged", judging())
    said: list[str] = []
    assert campaign.campaign(range(1, 11), processes=0, provoking={"a kill", "a restart"}, say=said.append) == 1
    assert said[:2] == ["in so many runs: a kill 3, a restart 0", "never happened, and should have: a restart"]
    assert said[-1].endswith(": 0 failed")
    assert campaign.campaign(range(1, 11), processes=0, provoking={"a kill"}, say=said.append) == 0


def test_what_a_campaign_of_its_length_should_provoke() -> None:
    """One seed again, to look at it, need not provoke anything."""
    assert campaign.expected(1, 1) == set()
    assert campaign.expected(200, 0) == PROVOKED
    assert campaign.expected(200, 10) == PROVOKED | {RETRACTION}
    assert campaign.expected(30, 5) == {RETRACTION}


def test_most_of_what_can_happen_does_in_few_runs() -> None:
    seen = set[str]().union(*(judged(seed, processes=False).happened for seed in SEEDS))
    assert len(PROVOKED - seen) <= 4, PROVOKED - seen
    assert seen >= {"a restart with what was stored", "an empty battery", "a frame lost: frozen", "a lost token"}


def test_a_frame_taken_back_is_noted(monkeypatch: pytest.MonkeyPatch) -> None:
    metrics = {"timing": {"retractions": 2}}
    monkeypatch.setattr(campaign, "disagreements", lambda plan: ([], Compared(metrics, ())))
    assert RETRACTION in campaign.judged(SOUND, processes=True).happened
    metrics["timing"]["retractions"] = 0
    assert RETRACTION not in campaign.judged(SOUND, processes=True).happened
