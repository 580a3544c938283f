"""How a process asks for its place in a run."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Final

import msgpack
import zenoh

from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.wire import keys

JOIN_TIMEOUT_S: Final = 60.0
ASK_TIMEOUT_S: Final = 10.0
"""For one query: if thousands ask at once, a query or its reply may get lost."""
TIMEOUT: Final = "Timeout"
"""Zenoh's own reply to a query that was not answered in time."""
JOIN_RETRY_S: Final = 0.2


class JoinError(RuntimeError):
    """The launcher has no place for this process, or does not answer."""


@dataclass(frozen=True, slots=True)
class Joined:
    """The launcher's reply to a process that joins, before or during the run.

    ``start_ns`` is the host's monotonic time at which emulated time began (None: not yet), ``stored`` what an earlier
    life of the process stored last (``Store``), if that life ended unplanned.
    """

    run: RunSpec
    process: ProcessSpec
    start_ns: int | None
    stored: bytes | None = None


def join(session: zenoh.Session, name: str) -> Joined:
    """Ask the launcher for everything that the process of this name needs. Raises ``JoinError``."""
    deadline = time.monotonic() + JOIN_TIMEOUT_S
    while time.monotonic() < deadline:
        for reply in session.get(keys.JOIN, payload=name, timeout=ASK_TIMEOUT_S):
            if reply.ok is None:
                why = reply.err.payload.to_string() if reply.err else "refused"
                if why == TIMEOUT:
                    break
                raise JoinError(f"{name}: {why}")
            answer = msgpack.unpackb(reply.ok.payload.to_bytes(), strict_map_key=False)
            process = ProcessSpec.from_plain(answer["process"])
            return Joined(RunSpec(**answer["run"]), process, answer["start_ns"], answer["stored"])
        time.sleep(JOIN_RETRY_S)
    raise JoinError(f"{name}: no launcher answers in this run")
