"""A short form of the campaign of faults, and that it finds what is wrong."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests import campaign
from tests.campaign import KINDS, LINKS, Case, Run, case, complaints, run
from trackfield.role import NS

SEEDS = range(1, 31)


def test_small_fields_under_everything_at_once() -> None:
    said: list[str] = []
    assert campaign.campaign(SEEDS, processes=0, say=said.append) == 0, "\n".join(said)


def test_all_that_can_be_drawn_is_drawn() -> None:
    cases = [case(seed).settings for seed in SEEDS]
    assert {fault["kind"] for case in cases for fault in case["faults"]} == set(KINDS)
    assert {case["link.model"] for case in cases} == {LINKS[name](campaign.Draw(1))["model"] for name in LINKS}
    assert {1, 2, 3, 4, 5, 6} == {len(case["faults"]) for case in cases}
    befallen = {id for case in cases for fault in case["faults"] for id in fault.get("nodes", ())}
    assert "fusion" in befallen


def test_a_seed_draws_the_same_again() -> None:
    assert Case(7).settings == Case(7).settings
    assert Case(7).settings != Case(8).settings


@pytest.mark.alone
@pytest.mark.timeout(400)
def test_both_drivers_agree_on_one() -> None:
    assert campaign.failures(3, processes=True) == []


# --- what it would find -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sound() -> Run:
    """A run in which nothing is wrong, with reports and a track."""
    found = run(case(3).plan)
    assert list(complaints(found)) == []
    assert any(row.kind == "doa" and row.delivered for row in found.ledger.rows)
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
    row = next(row for row in spoilt.ledger.rows if row.kind == "doa")
    spoilt.ledger.rows.append(replace(row, sent_ns=row.sent_ns + 5))
    assert any(f"reports step {row.step} 2 times" in what for what in complaints(spoilt))


def test_a_track_that_is_no_number(sound: Run) -> None:
    i = next(i for i, row in enumerate(sound.tracks) if row.point.mean)
    point = replace(sound.tracks[i].point, mean=(1.0, float("nan"), 0.0, 0.0))
    spoilt = replace(sound, tracks=[*sound.tracks[:i], replace(sound.tracks[i], point=point)])
    assert any("is no number" in what for what in complaints(spoilt))


def test_a_life_after_death_and_a_stir_in_the_frost(sound: Run) -> None:
    spoilt = again(sound)
    row = next(row for row in spoilt.ledger.rows if row.kind == "doa" and not row.incarnation)
    diary = spoilt.ledger.diaries[row.src]
    diary.spec = replace(diary.spec, kill_ns=row.sent_ns)
    assert any(f"{row.src} acts at" in what and "outside" in what for what in complaints(spoilt))
    diary.spec = replace(diary.spec, kill_ns=None, freezes=((row.sent_ns, row.sent_ns + NS),))
    assert any(f"{row.src} acts at" in what and "frozen" in what for what in complaints(spoilt))


def test_a_run_without_end(sound: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign, "MAX_EVENTS", 10)
    assert any("does not end" in what for what in complaints(run(sound.plan)))


def test_a_failing_seed_is_told_as_the_command_that_repeats_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(seed: int, *, processes: bool) -> list[str]:
        return ["the sky fell"] if seed == 5 else []

    monkeypatch.setattr(campaign, "failures", broken)
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
    assert "ZeroDivisionError" in campaign.failures(1, processes=False)[0]
