"""What a life takes over from the one before it: stored bytes, and a partly used battery."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import msgpack
import zenoh
from zenoh.handlers import Callback

from trackfield.drivers.meter import NOTHING, spent
from trackfield.drivers.spec import ProcessSpec
from trackfield.wire import keys

PATIENCE_NS: Final = 5_000_000_000
"""How long a life waits for the final record of the one before it (wall time)."""


class Heritage:
    """``stored`` and ``spent`` are valid once ``known``: from the launcher, or from the final record of that life.

    ``tell`` is called when they come.
    """

    def __init__(
        self, session: zenoh.Session, spec: ProcessSpec, stored: bytes | None, tell: Callable[[], None]
    ) -> None:
        self.stored, self.spent = stored or b"", NOTHING
        self.known = not spec.incarnation or stored is not None
        self._tell = tell
        if not self.known:
            listeners = {"stored": self._on_stored, "final": self._on_final}
            self._held = [
                session.declare_subscriber(keys.telemetry(spec.before, what), Callback(listener, indirect=False))
                for what, listener in listeners.items()
            ]

    def _on_stored(self, sample: zenoh.Sample) -> None:
        self.stored = sample.payload.to_bytes()

    def _on_final(self, sample: zenoh.Sample) -> None:
        record = msgpack.unpackb(sample.payload.to_bytes(), strict_map_key=False)
        self.stored, self.spent = record["stored"], spent(record)
        self.known = True
        self._tell()
