"""The one error of the wire."""

from __future__ import annotations


class WireError(ValueError):
    """A message, key or attachment that does not conform to docs/wire.md.

    ``reason`` is a short name for counting: ``size``, ``malformed``, ``version``, ``kind``, ``fields``, ``type``,
    ``range``, ``key`` or ``envelope``; of a frame that no process of the run can have sent: ``sender``, ``receiver``,
    ``life``, ``future``, ``conflict``; of a serial line: ``line``; of anything else: ``process``, ``order``, ``seal``.
    """

    def __init__(self, reason: str, detail: str = "") -> None:
        self.reason = reason
        super().__init__(f"{reason}: {detail}" if detail else reason)
