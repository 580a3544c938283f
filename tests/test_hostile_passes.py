"""A hostile peer in a field that hears targets pass: whatever it says, no part of a run raises."""

from __future__ import annotations

import pytest

from tests.hostile import passes
from tests.hostile.direct import Parts
from tests.hostile.mixes import HARMLESS
from tests.hostile.samples import Draw
from trackfield.role import NS


@pytest.mark.parametrize("heads", ["fixed", "loudest"])
@pytest.mark.parametrize("seed", [1, 2])
def test_the_parts_of_a_field_that_hears_refuse_what_is_bad(heads: str, seed: int) -> None:
    draw, plan = Draw(seed), passes.plan_of(heads)
    draw.known = passes.known_of(plan)
    kinds = (*HARMLESS[:4], *[passes.FORGED] * 12)
    parts = Parts(plan, b"", passes.LIVES, kinds, after_ns=plan.origin_ns + 5 * NS)
    assert parts.attacked(draw) == []
    ledger = parts.listener.ledger
    assert set(ledger.sent_kinds) >= {"interest", "data", "fix"}
    assert all(process.record()["delivered"] for process in parts.processes)
