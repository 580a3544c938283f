"""Nodes that sense a target elect a head, and join it (Zhou et al. 2011, section II)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from launcher.plan.architectures.field import Field
from launcher.plan.architectures.peers import Peers
from launcher.plan.architectures.periods import Needs


@dataclass(frozen=True)
class Elected(Peers):
    """The head picks the best ``sensors`` of those that joined it; see the keys in docs/scenarios.md."""

    sensors: int = 3
    keep_within: float = 0.5
    lease_steps: int = 2
    local: bool = False
    combine: str = "product"

    def needs(self, field: Field) -> Needs:
        """See ``Peers``."""
        needs = self._needs(field, short=False, lease=self.lease_steps)
        return replace(needs, report=needs.word) if self.local else needs

    def settings(self, field: Field) -> dict[str, Any]:
        """See ``Peers``."""
        range_m = max(section.sensing.range_m for section in field.site.sections.values())
        return {
            "joins": True,
            "keep_within_m": self.keep_within * range_m,
            "takes_over": False,
            "short": False,
            **({"local": self.combine} if self.local else {}),
        }
