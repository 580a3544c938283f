"""The plan of a seed: who talks, and everything about them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Final

from launcher.records import Plan
from tests.campaign import fields, talkers
from tests.campaign.draws import Draw
from tests.protocols.parties import PARTIES

FIELD: Final = "field"
"""The talkers of a field that tracks a target."""
TALKERS: Final = (FIELD, *PARTIES)
SHARES: Final = (len(PARTIES), *[1] * len(PARTIES))
"""How often each is drawn: half of the seeds are fields."""


@dataclass(frozen=True)
class Case:
    """All that a seed draws."""

    seed: int

    @cached_property
    def talkers(self) -> str:
        (one,) = Draw(f"talkers {self.seed}").choices(TALKERS, SHARES)
        return one

    @cached_property
    def plan(self) -> Plan:
        if self.talkers == FIELD:
            return fields.field(fields.settings(self.seed))
        return talkers.plan(self.talkers, self.seed)


@cache
def case(seed: int) -> Case:
    """Planning takes longer than many a run."""
    return Case(seed)
