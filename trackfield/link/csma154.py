"""The delays of unslotted CSMA-CA alone: every frame is received unless its sender gives up channel access."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from trackfield.link.fate import FIELD, Transmission
from trackfield.link.radios import RADIOS
from trackfield.link.transfer import ByRadio, Prr, Transfer


@dataclass(frozen=True)
class Csma154(ByRadio):
    """An 802.15.4 radio at short range; ``busy``, ``ack`` and ``acks`` as in ``Transfer``."""

    seed: int
    busy: float = 0.0
    ack: int = 0
    acks: Mapping[str, int] = field(default_factory=dict)
    _transfer: Transfer = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        radio = RADIOS["802154-0dbm"](0)
        object.__setattr__(self, "_transfer", Transfer(self.seed, radio, self.busy, self.ack, self.acks))

    def _prrs(self, frame: Transmission) -> tuple[Prr, Prr]:
        return _always, _always

    def reception(
        self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0, medium: str = FIELD
    ) -> float:
        """See ``Link.reception``."""
        return self._transfer.reception(size, kind, _always)


def _always(frame_bytes: int) -> float:
    return 1.0
