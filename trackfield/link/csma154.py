"""The delays of unslotted CSMA-CA alone: every frame is received unless its sender gives up channel access."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from trackfield.link.fate import FIELD, Fate, Transmission
from trackfield.link.radios import RADIOS, Radio
from trackfield.link.transfer import OnAir, Transfer


@dataclass(frozen=True)
class Csma154:
    """An 802.15.4 radio at short range; ``busy``, ``ack`` and ``acks`` as in ``Transfer``."""

    seed: int
    busy: float = 0.0
    ack: int = 0
    acks: Mapping[str, int] = field(default_factory=dict)
    _transfer: Transfer = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        radio = RADIOS["802154-0dbm"](0)
        object.__setattr__(self, "_transfer", Transfer(self.seed, radio, self.busy, self.ack, self.acks))

    def fate(self, frame: Transmission) -> Fate:
        """See ``Link.fate``."""
        return self._transfer.fate(frame, _always, _always)

    @property
    def radio(self) -> Radio:
        """Its radio."""
        return self._transfer.radio

    def tries(self, frame: Transmission) -> int:
        """How often each fragment of a frame is sent at most."""
        return self._transfer.tries(frame)

    def on_air(self, frame: Transmission) -> tuple[OnAir, ...]:
        """The transmissions of which the fate of a frame is made."""
        return self._transfer.on_air(frame, _always, _always)

    def reception(
        self, src: str, dst: str, size: int, kind: str | None = None, at_ns: int = 0, medium: str = FIELD
    ) -> float:
        """See ``Link.reception``."""
        return self._transfer.reception(size, kind, _always)


def _always(frame_bytes: int) -> float:
    return 1.0
