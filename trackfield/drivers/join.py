"""How a process asks for its place in a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import zenoh

from trackfield.drivers.ask import JoinError, ask
from trackfield.drivers.intake import Refusals, read
from trackfield.drivers.seal import Seal
from trackfield.drivers.spec import ProcessSpec, RunSpec
from trackfield.wire import keys
from trackfield.wire.error import WireError


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


def join(session: zenoh.Session, name: str, factory: str, seal: Seal, refused: Refusals) -> Joined:
    """Ask the launcher for everything that the process of this name, made by ``factory``, needs.

    Raises ``JoinError``; answers that are not the launcher's are ``refused``.
    """
    try:
        return read(joined, ask(session, keys.JOIN, name.encode(), seal, refused), name, factory)
    except (JoinError, WireError) as error:
        raise JoinError(f"{name}: {error}") from None


def joined(answer: Mapping[str, Any], name: str, factory: str) -> Joined:
    """The launcher's answer in plain form. Raises ``WireError``, or whatever is wrong with it."""
    process = ProcessSpec.from_plain(answer["process"], factory)
    start_ns, stored = answer["start_ns"], answer["stored"]
    if process.name != name or type(start_ns) not in (int, type(None)) or type(stored) not in (bytes, type(None)):
        raise WireError("malformed", "an answer to another question")
    return Joined(RunSpec(**answer["run"]), process, start_ns, stored)
