"""What befalls the machine of a run whose processes answer each other is repaired, or it is counted; never silent."""

from __future__ import annotations

import os
import signal
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import pyarrow.parquet as pq
import pytest
import zenoh

from launcher.processes.deployment import Deployment
from launcher.records import ARRIVED, ROUTER, Plan
from launcher.run import Outcome, run_processes, run_virtual
from launcher.show import Quiet
from launcher.study.compare import differences
from tests.protocols import election, ring
from tests.test_drivers_agree import SHARED, toy_plan
from trackfield.drivers.exchange.incoming import HORIZON_S
from trackfield.drivers.session import open_client
from trackfield.role import NS

Deed = tuple[float, Callable[[Deployment], object]]
"""Something that is done to a run at this time (emulated s)."""
TRIES: Final = 3
"""For what is not certain to happen on a machine with other things to do."""


def to(name: str, number: int) -> Callable[[Deployment], object]:
    """Sends a signal to the process of this name."""
    return lambda field: os.kill(field.pids()[name], number)


def end(_: Deployment) -> None:
    """As Ctrl-C does."""
    os.kill(os.getpid(), signal.SIGINT)


class Hands(Quiet):
    """Does things to a run, each as soon as it is time, and some before it begins."""

    def __init__(self, deeds: Sequence[Deed], before: Callable[[Deployment], object]) -> None:
        self.field: Deployment | None = None
        self._deeds, self._before = list(deeds), before

    def introduced(self, field: Deployment) -> None:
        self.field = field
        self._before(field)

    def running(self, status: dict[str, Any]) -> None:
        while self.field and self._deeds and self.field.now_ns >= self._deeds[0][0] * NS:
            self._deeds.pop(0)[1](self.field)


@dataclass(frozen=True)
class Seen:
    """A run as processes, and all in which it differs from the run in virtual time that ends when it ended."""

    outcome: Outcome
    found: tuple[str, ...]

    @property
    def host_late(self) -> int:
        return int(self.outcome.metrics["timing"]["host_late"])

    @property
    def counted(self) -> dict[str, int]:
        """All counts of what the machine did wrong that are not 0."""
        metrics = self.outcome.metrics
        counts = {
            "host_late": self.host_late,
            "unsettled": metrics["timing"]["unsettled"],
            "host_lost": metrics["frames"]["host_lost"],
            "dropped": metrics["recorder"]["dropped"],
            "complaints": len(metrics["recorder"]["complaints"]),
        }
        return {name: count for name, count in counts.items() if count}


Disturbed = Callable[..., Seen]


@pytest.fixture
def disturbed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Disturbed:
    """Runs a plan while these deeds are done to it."""
    tries = 0

    def run(plan: Plan, *deeds: Deed, before: Callable[[Deployment], object] = lambda _: None) -> Seen:
        nonlocal tries
        tries += 1
        hands, enter = Hands(deeds, before), Deployment.__enter__

        def introduced(field: Deployment) -> Deployment:
            hands.introduced(entered := enter(field))
            return entered

        real, virtual = (tmp_path / f"{name}-{tries}" for name in ("processes", "virtual"))
        for folder in (real, virtual):
            (folder / "logs").mkdir(parents=True)
        with monkeypatch.context() as patched:
            patched.setattr(Deployment, "__enter__", introduced)
            outcome = run_processes(plan, real, hands)
        ended_ns = round(outcome.metrics["ended_s"] * NS)
        cut = run_virtual(replace(plan, run=replace(plan.run, end_ns=ended_ns)), virtual).metrics
        found = list(differences(real, virtual, 0.0))
        found += [part for part in ("frames", *SHARED) if outcome.metrics[part] != cut[part]]
        return Seen(outcome, tuple(found))

    return run


def elected(seconds: int, size: int = 4, **changes: Any) -> Plan:
    """Contenders that claim and relay claims, at the speed of the clock; one of them differs by ``changes``."""
    run, (first, *others) = election.party(1, size=size, seconds=seconds)
    return toy_plan(run, [replace(first, **changes), *others])


def hurried(plan: Plan) -> Plan:
    """The same at a speed at which answers always come late, and frames are taken back."""
    return replace(plan, run=replace(plan.run, speed=5.0))


def fair(seen: Seen) -> Seen:
    """A run that is equal to its virtual run, or else says so."""
    assert not seen.found or seen.counted, seen.found
    return seen


# --- deaths -----------------------------------------------------------------------------------------------------------


def late_words(disturbed: Disturbed, back_s: float) -> Seen:
    """c00 is killed at 2.9 s; c01 stands still from before its claims of second 2 are made, until ``back_s``."""
    deeds = [(1.8, to("c01", signal.SIGSTOP)), (back_s, to("c01", signal.SIGCONT))]
    return fair(disturbed(elected(6, kill_ns=2900 * NS // 1000), *deeds))


def test_a_killed_life_takes_in_what_comes_before_its_last_word(disturbed: Disturbed) -> None:
    """Claims of before its death, which reach it after it: it goes back and ends as it should have."""
    for _ in range(TRIES):
        seen = late_words(disturbed, 3.0)
        if not seen.counted:
            break
    assert seen.counted == {}
    assert seen.found == ()
    rows = pq.read_table(seen.outcome.folder / "messages.parquet").to_pylist()
    held = [row for row in rows if (row["src"], row["dst"]) == ("c01", "c00") and row["sent_ns"] > 1.9 * NS]
    assert any(row["outcome"] in ARRIVED for row in held)


def test_what_comes_after_a_last_word_is_late(disturbed: Disturbed) -> None:
    """Nobody applies it any more, and the ledger says so."""
    for _ in range(TRIES):
        seen = late_words(disturbed, 4.5)
        if seen.host_late:
            break
    assert seen.host_late > 0
    frames = seen.outcome.metrics["frames"]
    lost = sum(frames["lost"].values())
    assert frames["expected"] == frames["delivered"] + lost + frames["host_lost"] + frames["host_late"]


# --- stops ------------------------------------------------------------------------------------------------------------


def test_a_stop_below_the_horizon_is_repaired(disturbed: Disturbed) -> None:
    for _ in range(TRIES):
        seen = fair(disturbed(elected(5), (1.5, to("c01", signal.SIGSTOP)), (3.0, to("c01", signal.SIGCONT))))
        if not seen.counted:
            break
    assert seen.counted == {}
    assert seen.found == ()
    assert seen.outcome.metrics["timing"]["lag_ms"]["max"] > 500
    assert seen.outcome.metrics["timing"]["retractions"] > 0


def test_a_stop_beyond_the_horizon_is_late(disturbed: Disturbed) -> None:
    back_s = 1.5 + HORIZON_S + 1.5
    seen = disturbed(elected(10), (1.5, to("c01", signal.SIGSTOP)), (back_s, to("c01", signal.SIGCONT)))
    assert seen.host_late > 0
    assert fair(seen).found


# --- what the router takes with it ------------------------------------------------------------------------------------


def test_a_router_that_is_replaced_costs_nothing_silently(disturbed: Disturbed) -> None:
    """The token of a ring was under way, or was not: a run is equal to its virtual run, or fails and says how much."""
    for _ in range(TRIES):
        plan = toy_plan(*ring.party(1, seconds=6))
        seen = fair(disturbed(plan, (2.0, to(ROUTER, signal.SIGKILL)), (4.0, to(ROUTER, signal.SIGKILL))))
        assert [death["id"] for death in seen.outcome.metrics["processes"]["died"]] == [ROUTER] * 2
        assert seen.outcome.exit_code == 1
        if seen.found:
            break
    assert seen.counted.get("host_lost", 0) + seen.counted.get("dropped", 0) > 0
    assert any("host_lost" in text or "dropped" in text for text in seen.outcome.complaints)


# --- the end ----------------------------------------------------------------------------------------------------------


def test_a_run_that_is_ended_early_is_the_run_up_to_then(disturbed: Disturbed) -> None:
    for _ in range(TRIES):
        seen = fair(disturbed(elected(60), (2.0, end)))
        assert seen.outcome.exit_code == 128 + signal.SIGINT, seen.outcome.complaints
        assert 2.0 < seen.outcome.metrics["ended_s"] < 50
        if not seen.counted:
            break
    assert seen.counted == {}
    assert seen.found == ()


# --- somebody from outside --------------------------------------------------------------------------------------------


class Device:
    """Hears all frames as docs/wire.md says, with plain Zenoh: the last version of each, and an empty one is none."""

    def __init__(self) -> None:
        self.puts = self.words = 0
        self._latest: dict[tuple[Any, ...], tuple[int, bytes]] = {}

    def come(self, field: Deployment) -> None:
        self._session = open_client(field.door.endpoint, field.plan.run.run)
        self._held = self._session.declare_subscriber("data/**", self._hear)

    def leave(self) -> None:
        self._session.close()  # type: ignore[no-untyped-call]

    def _hear(self, sample: zenoh.Sample) -> None:
        assert sample.attachment is not None
        key, payload = str(sample.key_expr), sample.payload.to_bytes()
        sent_ns, incarnation, copy, _, _, version = struct.unpack("<qHHIqI", sample.attachment.to_bytes())
        self.puts, self.words = self.puts + 1, self.words + (not payload)
        identity = key, sent_ns, incarnation, copy
        if version >= self._latest.get(identity, (-1, b""))[0]:
            self._latest[identity] = version, payload

    def frames(self) -> set[tuple[str, int, bytes]]:
        """Sender, time and content of all that hold."""
        live = ((key.split("/"), at, payload) for (key, at, *_), (_, payload) in self._latest.items() if payload)
        return {(names[-2], at, payload) for names, at, payload in live}


def test_a_device_that_hears_a_frame_and_its_retraction_knows_what_holds(disturbed: Disturbed) -> None:
    for _ in range(TRIES):
        device = Device()
        seen = fair(disturbed(hurried(elected(8, size=8)), before=device.come))
        device.leave()
        if device.words and not seen.counted:
            break
    assert device.words > 0
    assert device.puts > len(device.frames())
    rows = pq.read_table(seen.outcome.folder / "messages.parquet").to_pylist()
    assert any(row["outcome"] in ARRIVED for row in rows)
    assert device.frames() == {(row["src"], row["sent_ns"], row["payload"]) for row in rows}
    assert seen.found == ()
