"""How large what comes to the router of a secured run may be, payload and attachment together.

Its receivers check the same; what is larger does not come to them, and is counted as an attempt. There is no limit of
how many: what Zenoh can do is to drop what follows another too soon, and the reports of a field come in bursts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import Any, Final

from launcher.record.samples import MAX_EVENT
from launcher.security.sessions import RUN, SESSIONS
from trackfield.drivers.exchange.intake import MAX_PLAIN
from trackfield.drivers.exchange.seal import SEAL_BYTES
from trackfield.drivers.joining.ask import MAX_QUESTION
from trackfield.drivers.joining.credentials import GUEST
from trackfield.drivers.spec import ProcessSpec
from trackfield.wire import keys
from trackfield.wire.envelope import LONGEST
from trackfield.wire.registry import MAX_BYTES, kinds

SHORT: Final = ("event", "counts", "status")
"""Telemetry of which each piece is short."""


def limits(run: str, processes: Iterable[ProcessSpec], slices: int = 0) -> dict[str, Any]:
    """Zenoh's ``low_pass_filter`` for a run, and what its router is told of its sessions.

    Of several limits for a key the lowest holds. Planned lives of one process are processes of their own; a slice asks
    for its share before it has a router.
    """
    lives = Counter(life.id for life in processes)
    sessions = {GUEST: None, **{id: n for id, n in lives.items() if n > 1}}
    sessions |= {keys.slice_name(number): 2 for number in range(1, slices + 1)}
    return {
        "metadata": {RUN: run, SESSIONS: sessions},
        "low_pass_filter": [
            {"id": f"l{i}", "flows": ["ingress"], "messages": [what], "key_exprs": [f"{run}/{key}"], "size_limit": most}
            for i, (what, key, most) in enumerate(_limits())
        ],
    }


def _limits() -> Iterator[tuple[str, str, int]]:
    """Kind of message, key, and the most bytes."""
    yield "put", keys.ALL_DATA, MAX_BYTES + LONGEST
    for kind in kinds():
        yield "put", f"data/*/*/*/*/{kind.name}", kind.most_bytes + LONGEST
    yield "put", keys.ALL_TELEMETRY, MAX_PLAIN + SEAL_BYTES
    for what in SHORT:
        yield "put", keys.telemetry_of_all(what), MAX_EVENT + SEAL_BYTES
    yield "query", keys.ALL_CONTROL, MAX_QUESTION + SEAL_BYTES
