"""The protocols by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from tests.protocols import collection, dozing, election, hosted, relay, ring
from trackfield.drivers.spec import ProcessSpec, RunSpec

Party = tuple[RunSpec, list[ProcessSpec]]

PARTIES: Final[Mapping[str, Callable[..., Party]]] = {
    "election": election.party,
    "relay": relay.party,
    "ring": ring.party,
    "hosted": hosted.party,
    "dozing": dozing.party,
    "collection": collection.party,
}
"""Each makes a party of a ``seed``, and of a ``speed``, ``size``, ``seconds`` and ``loss`` if they are given."""
KINDS: Final[Mapping[str, frozenset[str]]] = {
    "election": frozenset({"bid"}),
    "relay": frozenset({"parcel", "taken"}),
    "ring": frozenset({"token"}),
    "hosted": frozenset({"ask", "answer"}),
    "dozing": frozenset({"call", "reply-to-call", "news"}),
    "collection": frozenset({"hop"}),
}
"""The messages of each."""
