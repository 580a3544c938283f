"""Whole fields with a gateway, in virtual time: next to camera control, over three hops with loss, and cut on a side.

The target passes four times; each pass ends with a fix, at 12.8, 32.8, 58.8 and 79.8 s.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

import pytest

from launcher.plan.prepare import load, planned
from launcher.record.figures.hops import end_to_end
from launcher.record.ledger import Ledger
from launcher.record.metrics import run_metrics
from launcher.records import MessageRow, Plan
from tests.simulated import simulated
from trackfield.role import NS, State, Tell
from trackfield.wire.codec import decode
from trackfield.wire.outside import Item

QUICK = ("sensor.waveform=false", "fusion.trackers=['ml']")
CAMERA = (*QUICK, "camera.kind=evi-d30")
HOPS = (
    *CAMERA,
    "camera.hops=[[60,-60],[100,-60],[70,-40]]",
    "backbone.model=lognormal_prr",
    "backbone.radio=wifi11b",
    "camera.hop_s=0.02",
)
FIXES_S = [12.8, 32.8, 58.8, 79.8]


class Done(NamedTuple):
    """A run."""

    plan: Plan
    ledger: Ledger

    def told(self, process: str = "base") -> list[tuple[float, tuple[Any, ...]]]:
        """When (s) a gateway told what of itself, in the life of this name."""
        diary = self.ledger.diaries[process].told
        found = ((one.key[0], one.effect) for one in diary if isinstance(one.effect, Tell))
        return [(self.after_s(at), tell.values) for at, tell in found if tell.topic == "gateway"]

    def waited(self, process: str = "base") -> tuple[list[float], list[float]]:
        """When (s) messages came out of the field, and when they were acknowledged."""
        came, went, before = [], [], (0, 0, 0, 0, 0)
        for at_s, now in self.told(process):
            came += [at_s] * (sum(now[i] for i in (0, 1, 3)) - sum(before[i] for i in (0, 1, 3)))
            went += [at_s] * (now[1] - before[1])
            before = now
        return came, went

    def items(self) -> list[tuple[float, int]]:
        """When (s) an item of which fix (its step) came to camera control for the first time."""
        rows = [row for row in (*self.ledger.rows, *end_to_end((), self.ledger.rows)) if row.kind == "item"]
        first = dict[tuple[int, int], tuple[float, int]]()
        for row in sorted(rows, key=lambda row: row.due_ns or 0):
            item = decode(row.payload)
            if isinstance(item, Item) and row.due_ns is not None and row.outcome == "delivered":
                first.setdefault((item.life, item.number), (self.after_s(row.due_ns), decode(item.message).step))
        return list(first.values())

    def after_s(self, at_ns: int) -> float:
        return (at_ns - self.plan.origin_ns) / NS

    def rows(self, medium: str) -> list[MessageRow]:
        return [row for row in self.ledger.rows if row.medium == medium]


@cache
def run(*settings: str) -> Done:
    plan = planned(load("yang-ecpa", seed=1, settings=settings))
    return Done(plan, simulated(plan)[0])


def field_of(done: Done) -> list[tuple[Any, ...]]:
    """All that is to be known of each frame of the field."""
    return [
        (row.kind, row.src, row.dst, row.sent_ns, row.due_ns, row.outcome, row.payload) for row in done.rows("field")
    ]


def test_each_fix_is_passed_on_at_once() -> None:
    done = run(*CAMERA)
    assert [at_s for at_s, _ in done.items()] == pytest.approx(FIXES_S, abs=0.05)
    came, went = done.waited()
    assert came == pytest.approx(FIXES_S, abs=0.05)
    assert all(after - before < 0.01 for before, after in zip(came, went, strict=True))
    assert done.told()[-1][1] == (0, 4, 0, 0, 0)
    states = [one.effect.name for one in done.ledger.diaries["base"].told
              if isinstance(one.effect, State) and one.effect.lane == "gateway"]  # fmt: skip
    assert states == ["waiting", *["sending", "waiting"] * 4]


@pytest.mark.parametrize("settings", [CAMERA, HOPS], ids=["next to it", "three hops"])
def test_a_camera_changes_no_frame_of_the_field(settings: tuple[str, ...]) -> None:
    without = field_of(run(*QUICK))
    assert len(without) > 500
    assert field_of(run(*settings)) == without


def test_over_three_hops_the_figures_say_how_long_messages_took() -> None:
    done = run(*HOPS)
    assert [at_s for at_s, _ in done.items()] == pytest.approx([at_s + 0.07 for at_s in FIXES_S], abs=0.05)
    plan, ledger = done
    figures = run_metrics(plan, ledger, [])["latency_ms"]["hops"]
    rows = [row for row in end_to_end((), done.rows("backbone")) if row.outcome == "delivered"]
    assert figures.keys() == {"4"}
    assert figures["4"]["n"] == len(rows)
    assert {row.kind for row in rows} >= {"item", "item-ack", "subscribe"}
    assert 60.0 < figures["4"]["p50"] < figures["4"]["p95"] < 80.0
    first = next(row for row in ledger.rows if row.kind == "carried" and row.src == "base")
    assert first.text.startswith("item: ")
    assert "of base to camera-control, hop 1)" in first.text


def test_over_hops_that_lose_frames_each_fix_arrives_once_and_in_order() -> None:
    """Each frame is sent once, and one in seven is lost: of four items that are sent, one comes and is acknowledged."""
    done = run(*HOPS, "backbone.ack=1", "backbone.extra_loss=0.15", "run.idle_s=60")
    assert any(row.outcome not in ("delivered", "late") for row in done.rows("backbone") if row.kind == "carried")
    sent = sum(row.kind == "carried" and row.src == "base" for row in done.rows("backbone"))
    assert sent > 8
    steps = [step for _, step in done.items()]
    assert steps == sorted(set(steps))
    assert len(steps) == 4
    assert done.told()[-1][1] == (0, 4, 0, 0, 0)


def cut(medium: str, at_s: float, until_s: float) -> str:
    return f"faults=[{{kind='partition', nodes=['base'], medium='{medium}', at_s={at_s}, until_s={until_s}}}]"


def test_items_wait_while_the_backbone_is_cut() -> None:
    """Two fixes come meanwhile; both are acknowledged within eight times the patience after the cut."""
    done = run(*CAMERA, cut("backbone", 5, 45))
    steps = [step for _, step in done.items()]
    assert steps == sorted(set(steps))
    came, went = done.waited()
    assert came == pytest.approx(FIXES_S, abs=0.05)
    assert all(45.0 < at_s < 45.8 for at_s in went[:2])
    assert went[2:] == pytest.approx(FIXES_S[2:], abs=0.05)
    assert done.told()[-1][1] == (0, 4, 0, 0, 0)


def test_of_more_than_fit_the_oldest_is_dropped_while_the_backbone_is_cut() -> None:
    done = run(*CAMERA, cut("backbone", 5, 45), "camera.queue=1")
    assert done.told()[-1][1] == (0, 3, 0, 1, 0)
    whole = [step for _, step in run(*CAMERA).items()]
    assert [step for _, step in done.items()] == whole[1:]


def test_subscriptions_hold_while_the_field_is_cut() -> None:
    done = run(*CAMERA, cut("field", 20, 56))
    assert not [row for row in done.rows("backbone") if row.kind == "item" and 20 < done.after_s(row.sent_ns) < 55]
    assert [at_s for at_s, _ in done.items()][-2:] == pytest.approx(FIXES_S[2:], abs=0.05)
    assert done.told()[-1][1][2:] == (0, 0, 0)


def test_a_gateway_that_starts_again_knows_who_subscribed() -> None:
    """Camera control says so again at 47 s only."""
    done = run(*CAMERA, "faults=[{kind='restart', nodes=['base'], at_s=29, until_s=31}]")
    assert [at_s for at_s, _ in done.items()] == pytest.approx(FIXES_S, abs=0.05)
    assert done.told()[-1][1] == (0, 1, 0, 0, 0)
    assert done.told("base~1")[-1][1] == (0, 3, 0, 0, 0)
    asked = [done.after_s(row.sent_ns) for row in done.rows("backbone") if row.kind == "subscribe"]
    assert not [at_s for at_s in asked if 29 < at_s < 33]


def test_what_waits_for_camera_control_comes_when_it_starts_again() -> None:
    """The second fix comes while it is down; its next life asks for fixes at its start."""
    done = run(*CAMERA, "faults=[{kind='restart', nodes=['camera-control'], at_s=29, until_s=36}]")
    came, went = done.waited()
    assert came == pytest.approx(FIXES_S, abs=0.05)
    assert went == pytest.approx([FIXES_S[0], 36.0, *FIXES_S[2:]], abs=0.2)
    assert done.told()[-1][1] == (0, 4, 0, 0, 0)


def test_rules_of_the_scenario_hold() -> None:
    """The head is the first node; of another one nothing passes."""
    done = run(*CAMERA, "camera.heads=['n001']")
    assert done.items() == []
    assert done.told()[-1][1] == (0, 0, 4, 0, 0)
