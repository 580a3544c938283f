"""What a life takes over from the one before it: stored bytes, and a partly used battery."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import zenoh
from zenoh.handlers import Callback

from trackfield.drivers.engine.meter import Activities, spent
from trackfield.drivers.exchange.intake import Refusals, opened, read, unpacked
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.spec import ProcessSpec
from trackfield.wire import keys
from trackfield.wire.error import WireError

PATIENCE_NS: Final = 6_000_000_000
"""How long a life waits for the final record of the one before it (wall time), whose last word takes up to 5 s."""


class Heritage:
    """``stored`` and ``spent`` are valid once ``known``: from the launcher, or from the final record of that life.

    ``tell`` is called when they come.
    """

    def __init__(
        self,
        session: zenoh.Session,
        spec: ProcessSpec,
        stored: bytes | None,
        tell: Callable[[], None],
        seal: Seal,
        refused: Refusals,
    ) -> None:
        self.stored = stored or b""
        self.spent: Activities = {}
        self.known = not spec.incarnation or stored is not None
        self._tell, self._seal, self._refused = tell, seal, refused
        if not self.known:
            final = keys.telemetry(spec.before, "final")
            self._held = session.declare_subscriber(final, Callback(self._on_sample, indirect=False))

    def _on_sample(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        try:
            self.stored, self.spent = read(_bequeathed, unpacked(opened(sample, self._seal)))
        except WireError as error:
            self._refused.add(key, error)
            return
        self.known = True
        self._tell()


def _bequeathed(record: Any) -> tuple[bytes, Activities]:
    """What a final record leaves to the next life."""
    stored, used = record["stored"], spent(record)
    numbers = [n for one in used.values() for n in one]
    if not isinstance(stored, bytes) or not all(type(n) is int for n in numbers):
        raise WireError("malformed", "no final record")
    return stored, used
