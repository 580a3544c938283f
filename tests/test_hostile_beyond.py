"""A hostile peer beyond a gateway: whatever it says, and whatever it has others tell, no part of a run raises."""

from __future__ import annotations

import pytest

from tests.hostile import beyond
from tests.hostile.direct import Parts
from tests.hostile.mixes import HARMLESS
from tests.hostile.samples import Draw
from trackfield.drivers.engine.frames import Told
from trackfield.role import Tell


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_processes_beyond_a_gateway_refuse_what_is_bad(seed: int) -> None:
    draw, plan = Draw(seed), beyond.plan_of()
    draw.known = beyond.known_of(plan)
    kinds = (*HARMLESS[:4], *[beyond.FORGED] * 12)
    parts = Parts(plan, b"", tuple(beyond.HOSTS), kinds, after_ns=plan.origin_ns + beyond.AFTER_NS)
    assert parts.attacked(draw) == []
    assert {one.name for one in beyond.KINDS} <= set(parts.listener.ledger.sent_kinds)
    assert all(process.record()["delivered"] for process in parts.processes)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_recorder_takes_any_values_of_a_topic(seed: int) -> None:
    draw, plan = Draw(seed), beyond.plan_of()
    draw.known = beyond.known_of(plan)
    kinds = (*HARMLESS[:4], *[beyond.TOLD] * 12)
    parts = Parts(plan, b"", tuple(beyond.HOSTS), kinds, after_ns=plan.origin_ns + beyond.AFTER_NS)
    assert parts.attacked(draw) == []
    told = [
        one.effect for diary in parts.listener.ledger.diaries.values() for one in diary.told if isinstance(one, Told)
    ]
    assert {one.topic for one in told if isinstance(one, Tell)} == beyond.TOPICS.keys()
