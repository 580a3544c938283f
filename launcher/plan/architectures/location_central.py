"""The sensors nearest to the target measure, and one of them leads (Yu et al. 2009, section 4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from launcher.plan.architectures.field import Field
from launcher.plan.architectures.peers import Peers
from launcher.plan.architectures.periods import Needs


@dataclass(frozen=True)
class LocationCentral(Peers):
    """Of the ``sensors`` that measure one leads; if ``sticky``, as long as it is one of them."""

    sticky: bool = True

    def needs(self, field: Field) -> Needs:
        """See ``Peers``."""
        return self._needs(field, short=True, lease=2)

    def settings(self, field: Field) -> dict[str, Any]:
        """See ``Peers``."""
        return {"sticky": self.sticky, "takes_over": True, "short": True}
