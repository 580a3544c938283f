"""What a life takes over from the one before it: stored bytes, and a partly used battery."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import zenoh
from zenoh.handlers import Callback

from trackfield.drivers.engine.meter import Activities, Activity, spent
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
        left: tuple[bytes, bytes] | None,
        tell: Callable[[], None],
        seal: Seal,
        refused: Refusals,
    ) -> None:
        self.stored = b""
        self.spent: Activities = {}
        self.known = not spec.incarnation or left is not None
        self._tell, self._seal, self._refused = tell, seal, refused
        if left is not None:
            self._take(*left)
        if not self.known:
            final = keys.telemetry(spec.before, "final")
            self._held = session.declare_subscriber(final, Callback(self._on_sample, indirect=False))

    def _take(self, stored: bytes, spent: bytes) -> None:
        """Take over what a life that died unplanned had stored, and had said that it took from its battery."""
        self.stored = stored
        try:
            self.spent = read(_activities, unpacked(spent)) if spent else {}
        except WireError as error:
            self._refused.add("spent", error)

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
    stored, used = record.get("stored", b""), _whole(spent(record))
    if not isinstance(stored, bytes):
        raise WireError("malformed", "no final record")
    return stored, used


def _activities(told: Any) -> Activities:
    """What a life said that it took from its battery."""
    return _whole({medium: Activity(*parts) for medium, parts in told.items()})


def _whole(used: Activities) -> Activities:
    """The same, if all of it is in whole numbers. Raises ``WireError``."""
    if not all(type(n) is int for one in used.values() for n in one):
        raise WireError("malformed", "no use of a battery")
    return used
