"""The seal on what the processes of a run tell each other outside the radio: orders, join replies, telemetry."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from hashlib import blake2b
from hmac import compare_digest
from struct import Struct
from typing import Final

from trackfield.wire.error import WireError

TOKEN: Final = "TRACKFIELD_TOKEN"
"""The variable of the environment with the token of a run whose processes start elsewhere: any text."""

_NUMBER: Final = Struct("<Q")
_MAC_BYTES: Final = 16
SEAL_BYTES: Final = _NUMBER.size + _MAC_BYTES


def token_from(environment: Mapping[str, str], run: str) -> bytes:
    """The token of a run that processes share which are started elsewhere.

    Empty if there is none, and they trust the router. What is sealed in one run has no valid seal in another.
    """
    text = environment.get(TOKEN, "").encode(errors="surrogateescape")
    return blake2b(text + b"\0" + run.encode()).digest() if text else b""


class Seal:
    """Keyed BLAKE2b (RFC 7693) over a key, a number that grows, and a payload; it goes along as the attachment.

    The key is the run's ``token``, a secret that a process has from its parent or its environment, never from the wire.
    Without one there are no seals, and everything passes. Numbers grow with the run's clock ``now_ns``: what follows at
    a key may come from another process.
    """

    def __init__(self, token: bytes = b"", now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self.token, self._now_ns = token, now_ns
        self._number = 0
        self._latest: dict[str, int] = {}

    def stamp(self, key: str, payload: bytes) -> bytes | None:
        """The attachment for this payload at this key."""
        if not self.token:
            return None
        self._number = max(self._number + 1, self._now_ns())
        number = _NUMBER.pack(self._number)
        return number + self._mac(key, number, payload)

    def check(self, key: str, payload: bytes, attachment: bytes | None) -> None:
        """Raise ``WireError`` (``seal``) unless a holder of the token sent this, later than all others at this key."""
        if not self.token:
            return
        number = self.known(key, payload, attachment)
        if number <= self._latest.get(key, 0):
            raise WireError("seal", "sent before")
        self._latest[key] = number

    def known(self, key: str, payload: bytes, attachment: bytes | None) -> int:
        """The number of this seal, of which nothing is kept: anyone may send the same again.

        Raises ``WireError`` (``seal``) unless a holder of the token made it.
        """
        stamp = attachment or b""
        number, mac = stamp[: _NUMBER.size], stamp[_NUMBER.size :]
        if self.token and not compare_digest(mac, self._mac(key, number, payload)):
            raise WireError("seal", "not sent by a process of this run")
        return int.from_bytes(number, "little")

    def mark(self, text: str) -> str:
        """A seal as text, for what has no attachment; empty without a token."""
        return self._mac(text, b"", b"").hex() if self.token else ""

    def _mac(self, key: str, number: bytes, payload: bytes) -> bytes:
        text = b"\0".join((key.encode(), number, payload))
        return blake2b(text, digest_size=_MAC_BYTES, key=self.token).digest()
