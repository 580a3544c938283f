"""The links of all media of a run as one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from trackfield.link.fate import FIELD, LOST, Fate, Link, Transmission


@dataclass(frozen=True, slots=True)
class Media:
    """Each transmission goes by the link of its medium; a medium without a link carries nothing."""

    links: Mapping[str, Link]

    def fate(self, frame: Transmission) -> Fate:
        """See ``Link.fate``."""
        link = self.links.get(frame.medium)
        fate = LOST if link is None else link.fate(frame)
        if not frame.preamble_ns or fate.air_ns:
            return fate
        longer = frame.preamble_ns  # on a link without a radio
        delay_ns = fate.delay_ns + longer if fate.cause is None else 0
        return replace(fate, delay_ns=delay_ns, span_ns=fate.span_ns + longer)

    def reception(
        self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0, medium: str = FIELD
    ) -> float:
        """See ``Link.reception``."""
        link = self.links.get(medium)
        return 0.0 if link is None else link.reception(src, dst, size, kind, at_ns, medium)
