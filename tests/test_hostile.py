"""A hostile peer at the router of a run: nothing that it sends stops, fools or takes over a process."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.hostile import field, mixes
from tests.hostile.attack import Attack, Result, attacked
from tests.hostile.direct import BLOCK, Parts, feed
from tests.hostile.mixes import HARMLESS, PLANES, only
from tests.hostile.peer import Peer
from tests.hostile.samples import ALARM, ALL, REFUSED, Bad, Draw, Known, Sample
from tests.running import Run

FLOOD = 10_000
FIELD = Known(("n000", "n001"), "fusion", ("fusion", "n000", "n001", "n001~1"), ("imm-ukf",), now_ns=5 * 10**9)


def drawn(bad: Bad, seed: int) -> Sample | None:
    draw = Draw(seed)
    draw.known = FIELD
    return bad.sample(draw)


# --- what is tried ------------------------------------------------------------------------------------------------


def test_each_plane_is_attacked() -> None:
    assert {bad.plane for bad in ALL.values()} == set(PLANES)
    assert {bad.follows for bad in ALL.values()} >= {REFUSED, ALARM, REFUSED | ALARM}


def test_a_seed_draws_the_same_samples_again() -> None:
    for bad in ALL.values():
        one, two = ([drawn(bad, seed) for seed in range(20)] for _ in range(2))
        for a, b in zip(one, two, strict=True):
            assert (a and (a.key, a.what, a.means)) == (b and (b.key, b.what, b.means))
    first, second = mixes.attack(7), mixes.attack(7)
    assert ([bad.what for bad in first.mix], first.rate) == ([bad.what for bad in second.mix], second.rate)


# --- real runs ----------------------------------------------------------------------------------------------------


def put_all_of(result: Result, attack: Attack) -> None:
    """Each kind was put while the run went on; an order can only be put once more if one was heard."""
    assert {bad.what for bad in attack.mix if not result.put[bad.what]} <= {"order once more"}


def test_samples_that_cannot_matter_change_nothing(tmp_path: Path) -> None:
    """Every kind of them, from the first moment of the run to its last."""
    attack = Attack(HARMLESS, seed=1, rate=200.0)
    result = attacked(attack, tmp_path)
    assert result.wrong == []
    put_all_of(result, attack)


@pytest.mark.long
def test_duplicates_alone_are_no_interference(tmp_path: Path) -> None:
    result = attacked(only("frame once more"), tmp_path)
    assert result.wrong == []
    assert result.run is not None
    assert result.run.code == 0
    assert result.run.metrics["frames"]["duplicate"] > 10


ORDERS = ("forged start", "forged end", "forged stop", "forged finish", "forged life", "mutated order")


def test_orders_that_are_not_the_launchers_are_not_followed(tmp_path: Path) -> None:
    attack = only(*ORDERS)
    result = attacked(attack, tmp_path)
    assert result.wrong == []
    put_all_of(result, attack)


@pytest.mark.parametrize(
    "kinds",
    [
        ("forged report", "forged report of the past"),
        ("frame once more with other content",),
        ("frame taken back", "frame replaced"),
        pytest.param(("forged threshold", "forged time", "forged question for the time"), marks=pytest.mark.long),
        ("forged track",),
        pytest.param(("forged event", "forged undoing"), marks=pytest.mark.long),
        pytest.param(("forged final record",), marks=pytest.mark.long),
    ],
)
def test_a_forgery_under_a_name_of_the_field_is_told(kinds: tuple[str, ...], tmp_path: Path) -> None:
    result = attacked(only(*kinds), tmp_path)
    assert result.wrong == []
    assert result.run is not None
    assert (result.run.code, result.run.alarming > 0) == (1, True)


def test_forgeries_in_a_tree_are_told_and_nobody_falls(tmp_path: Path) -> None:
    """Ways that do not exist, messages of anything, acknowledgements of what is under way."""
    names = ("forged beacon", "forged hop", "forged acknowledgement")
    attack = Attack([ALL[name] for name in names], seed=2, scenario_seed=field.TREE_SEED)
    result = attacked(attack, tmp_path)
    assert result.wrong == []
    put_all_of(result, attack)
    assert result.run is not None
    assert (result.run.code, result.run.alarming > 0) == (1, True)


@pytest.mark.long
@pytest.mark.alone
def test_a_flood_of_refused_samples_is_a_few_lines(tmp_path: Path) -> None:
    """Ten thousand in a second or two; the verdicts limit all logs to some dozens of lines."""
    kinds = ["no message", "sender that nobody knows", "event of wrong types", "key that is none", "bad final record"]

    def flood(run: Run, peer: Peer) -> None:
        run.started()
        draw = Draw(2)
        draw.known = peer.known
        for i in range(FLOOD):
            sample = ALL[kinds[i % len(kinds)]].sample(draw)
            assert sample is not None
            peer.send(sample)

    result = attacked(only(*kinds), tmp_path, also=flood)
    assert result.wrong == []
    assert result.total > FLOOD


# --- without a router ---------------------------------------------------------------------------------------------


def test_the_parts_of_a_run_refuse_what_is_bad_by_one_error() -> None:
    assert list(feed(1, 6 * BLOCK)) == []


@pytest.mark.parametrize(
    ("seed", "kinds"),
    [(1, {"doa", "sync-request", "sync-reply", "threshold"}), (field.TREE_SEED, {"route", "hop", "hop-ack"})],
)
def test_the_parts_that_are_fed_live(seed: int, kinds: set[str]) -> None:
    """They send, hear, hand on and refuse, and track if no tree has to be built first."""
    draw, plan = Draw(1), field.plan_of(seed)
    draw.known = field.known_of(plan)
    parts = Parts(plan, b"a secret")
    assert parts.attacked(draw) == []
    ledger = parts.listener.ledger
    assert set(ledger.sent_kinds) >= kinds
    assert ledger.estimates() or seed == field.TREE_SEED
    assert len(ledger.refused) > 5
    assert all(process.record()["delivered"] for process in parts.processes[:2])


def test_another_error_is_told_with_the_command_that_repeats_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise KeyError("no such thing")

    monkeypatch.setattr("launcher.record.listener.parse_telemetry", broken)
    [found] = feed(3, BLOCK)
    assert found.startswith("without a router: python -m tests.hostile --runs 0 --seed 3 --direct 1000\n  Traceback")
    assert "KeyError: 'no such thing'" in found
