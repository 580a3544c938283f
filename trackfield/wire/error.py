"""The one error of the wire."""

from __future__ import annotations


class WireError(ValueError):
    """A message, key or attachment that is not what docs/wire.md says.

    ``reason`` is a short slug to count by: ``size``, ``malformed``, ``version``, ``kind``, ``fields``,
    ``type``, ``range``, ``key`` or ``envelope``.
    """

    def __init__(self, reason: str, detail: str = "") -> None:
        self.reason = reason
        super().__init__(f"{reason}: {detail}" if detail else reason)
