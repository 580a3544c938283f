"""Planned kills and restarts of real processes: how they end, what they say before, and who goes on."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from launcher.processes.children import Children
from launcher.record.ledger import Ledger
from launcher.records import Plan
from launcher.run import Outcome, run_processes
from launcher.show import Quiet
from tests.mortals import lived
from tests.test_drivers_agree import both, toy_plan
from tests.toys import party
from trackfield.drivers.spec import ProcessSpec
from trackfield.drivers.virtual import Virtual
from trackfield.role import NS

MS = 1_000_000
IDEAL: dict[str, Any] = {"model": "ideal"}


def small(steps: int, speed: float) -> tuple[Any, ProcessSpec, list[ProcessSpec]]:
    """A run, its hub, and its three nodes."""
    run, (hub, *nodes) = party(3, steps=steps, link=IDEAL, speed=speed)
    keeper = replace(hub, factory="tests.mortals:Keeper")
    return run, keeper, [replace(node, factory="tests.mortals:Napper") for node in nodes]


def simulated(plan: Plan) -> Ledger:
    book = Ledger(plan.run, plan.processes)
    Virtual(plan.run, plan.processes, book).run()
    book.close()
    return book


class Witness(Quiet):
    """Sees how each process ended and when (monotonic); sends the launcher a signal at an emulated time (s)."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, signal_at: float = 1e9) -> None:
        self.ends: dict[str, tuple[str, float]] = {}
        self._signal_at = signal_at
        gone = Children.gone

        def noted(children: Children) -> list[tuple[str, str]]:
            ended = gone(children)
            self.ends |= {name: (why, time.monotonic()) for name, why in ended}
            return ended

        monkeypatch.setattr(Children, "gone", noted)

    def running(self, status: dict[str, Any]) -> None:
        if status and status["t_s"] >= self._signal_at:
            self._signal_at = 1e9
            os.kill(os.getpid(), signal.SIGINT)


def run(plan: Plan, folder: Path, witness: Witness) -> Outcome:
    return run_processes(plan, folder, witness)


def adds_up(outcome: Outcome) -> bool:
    frames = outcome.metrics["frames"]
    return bool(frames["expected"] == frames["delivered"] + sum(frames["lost"].values()) > 0)


def senders(folder: Path) -> set[tuple[str, int]]:
    """Whose frames, of which life, came to be."""
    rows: Sequence[dict[str, Any]] = pq.read_table(folder / "messages.parquet").to_pylist()
    return {(row["src"], row["incarnation"]) for row in rows}


def test_a_planned_kill_is_a_sigkill_after_the_last_word(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """t01 is killed at 3.5 s and t02 comes again at 6: both end by SIGKILL while the run goes on, and nothing is lost.

    What they counted is complete, to the last frame, as in virtual time.
    """
    spec, hub, nodes = small(9, 3.0)
    lives = lived(nodes[2], (0, 3500 * MS), (6 * NS, None))
    plan = toy_plan(spec, [hub, nodes[0], replace(nodes[1], kill_ns=3500 * MS), *lives])
    witness = Witness(monkeypatch)
    outcome = run(plan, tmp_path, witness)
    assert outcome.exit_code == 0, outcome.complaints
    assert outcome.metrics["processes"]["died"] == []
    ends = {name: why for name, (why, _) in witness.ends.items()}
    assert {name: ends[name] for name in ("t01", "t02")} == dict.fromkeys(("t01", "t02"), "signal 9")
    assert {ends[name] for name in ("hub", "t00", "t02~1")} == {"exit code 0"}
    last = witness.ends["hub"][1]
    assert all(last - witness.ends[name][1] > 1 for name in ("t01", "t02"))
    book = simulated(plan)
    assert outcome.metrics["frames"]["host_lost"] == outcome.metrics["recorder"]["dropped"] == 0
    assert outcome.metrics["frames"]["delivered"] == sum(row.delivered for row in book.rows)
    assert outcome.metrics["frames"]["lost"]["dead"] == sum(row.outcome == "dead" for row in book.rows) > 0
    assert senders(tmp_path) == {("hub", 0), ("t00", 0), ("t01", 0), ("t02", 0), ("t02", 1)}


def test_a_life_that_follows_at_once_waits_for_what_the_one_before_left(tmp_path: Path) -> None:
    """Hub and t02 are up again 0.2 s after their kills, which at this speed is sooner than their last words come.

    The hub goes on with the number that it had, and t02 with what is in its battery, all the same.
    """
    spec, hub, nodes = small(5, 4.0)
    spans = (0, 4500 * MS), (4700 * MS, None)
    battery = {"send_uw": 10, "receive_uw": 10, "listen_uw": 10, "sleep_uw": 10, "battery_fj": 50 * NS}
    last = replace(nodes[2], role="node", power=battery)
    plan = toy_plan(replace(spec, end_ns=5500 * MS), [*nodes[:2], *lived(last, *spans), *lived(hub, *spans)])
    real, found = both(plan, tmp_path)
    assert found == []
    assert real.metrics["lifetime_s"]["first_death"] == 5.2
    told = simulated(plan).estimates()
    assert [one.point.step for one in told if one.source == "hub"] == [1, 2, 3, 4, 5]


def test_a_run_ended_early_leaves_out_the_deaths_and_births_to_come(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """t00 should be killed at 50 s and t01 live again from 60 s on; the run is ended after 3 s."""
    spec, hub, nodes = small(499, 2.0)
    lives = lived(nodes[1], (0, 55 * NS), (60 * NS, None))
    plan = toy_plan(spec, [hub, replace(nodes[0], kill_ns=50 * NS), *lives, nodes[2]])
    witness, begun = Witness(monkeypatch, signal_at=3), time.monotonic()
    outcome = run(plan, tmp_path, witness)
    assert outcome.exit_code == 128 + signal.SIGINT, outcome.complaints
    assert time.monotonic() - begun < 150  # of 250
    ends = {name: why for name, (why, _) in witness.ends.items() if name not in ("router", "recorder")}
    assert ends == dict.fromkeys(("hub", "t00", "t01", "t01~1", "t02"), "exit code 0")
    assert senders(tmp_path) == {("hub", 0), ("t00", 0), ("t01", 0), ("t02", 0)}
    assert adds_up(outcome)
    assert outcome.metrics["frames"]["host_lost"] == 0


def test_a_kill_between_the_order_to_end_and_the_end_still_happens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nodes are killed one after the other as the run is ended: whenever it is, no death is reported."""
    spec, hub, nodes = small(99, 2.0)
    doomed = [replace(node, kill_ns=round(t * NS)) for node, t in zip(nodes, (3.2, 4.0, 5.0), strict=True)]
    witness = Witness(monkeypatch, signal_at=3)
    outcome = run(toy_plan(spec, [hub, *doomed]), tmp_path, witness)
    assert outcome.exit_code == 128 + signal.SIGINT, outcome.complaints
    assert outcome.metrics["processes"]["died"] == []
    assert witness.ends["t00"][0] == "signal 9"
    assert adds_up(outcome)


def test_an_empty_battery_ends_a_life_but_not_its_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It falls silent after 2 s, and says its last word when the run is over."""
    spec, hub, nodes = small(5, 2.0)
    power = {"send_uw": 10, "receive_uw": 10, "listen_uw": 10, "sleep_uw": 10, "battery_fj": 20 * NS}
    plan = toy_plan(spec, [hub, *nodes[:2], replace(nodes[2], role="node", power=power)])
    witness = Witness(monkeypatch)
    outcome = run(plan, tmp_path, witness)
    assert outcome.exit_code == 0, outcome.complaints
    assert witness.ends["t02"][0] == "exit code 0"
    assert outcome.metrics["lifetime_s"]["first_death"] == 2.0
    rows: list[dict[str, Any]] = pq.read_table(tmp_path / "messages.parquet").to_pylist()
    assert {row["outcome"] for row in rows if row["dst"] == "t02" and row["due_ns"] > 2 * NS} == {"dead"}
    assert max(row["sent_ns"] for row in rows if row["src"] == "t02") < 2 * NS
