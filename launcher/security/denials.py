"""What a router refused, from the lines of its log.

A router of Zenoh tells of a refusal in its log alone, by two lines of one thread: which session was "unauthorized" to
do what, and "Msg intercepted!". The first comes for much that nobody tried, too, as the router looks up all that a
session may do on a key at once; the second comes for each message that is dropped, whatever the reason.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from typing import Final

FILTER: Final = "zenoh::net::routing::interceptor=trace,zenoh_link_tls=warn,zenoh_link_commons=warn"
"""RUST_LOG of a router whose log is read; links over QUIC are among the ``commons``."""
UNKNOWN: Final = "unknown"
"""In place of a certificate that cannot be told."""
SIZE: Final = "size"
"""A message on a key where it may be, and larger than it may be there."""
STRANGER: Final = "certificate"
"""A certificate of the run's authority for which there are no rules."""

_LINE: Final = re.compile(
    rb"^[0-9T:.Z-]{20,40} +[A-Z]+ +(?:\S+ +)?ThreadId\((\d+)\) ([a-z_:]+): (.*)$",
    re.MULTILINE,
)
_CHECKED: Final = re.compile(
    rb"(?:Using cached result: )?(?P<session>[0-9a-f]{1,32}) .*?is (?P<no>un)?authorized to (?P<what>[A-Z][A-Za-z/ ]+) "
    rb"\((?P<flow>ingress|egress)\)"
)
_STRANGER: Final = re.compile(rb"([0-9a-f]{1,32}) did not match any configured ACL subject")
_DROPPED: Final = b"Msg intercepted!"
_LIMITED: Final = (b"Put", b"Query")
"""Messages that have limits of size."""
_LINKS: Final = b"zenoh_link_"
_HANDSHAKES: Final = {
    b"peer sent no certificates": "none",
    b"certificate expired": "expired",
    b"certificate not valid yet": "not yet valid",
    b"UnknownIssuer": "of another authority",
    b"BadSignature": "of another authority",
    b"invalid peer certificate": "invalid",
    b"received fatal alert": "of one who refuses the router's",
    b"received corrupt message": "none, no TLS",
}
"""What was wrong with a certificate, by what the log says. All else is a connection that broke, or on which nothing was
said: by one who looks whether there is a router, or who ended.
"""


class Denials:
    """Counts attempts; ``certificate_of`` tells the common name of a session by its id (empty: not known yet).

    ``handshakes`` are connections that were refused, by what was wrong with their certificate. A name is never taken
    from the log: a key with a line break in it can hold any text.
    """

    def __init__(self, certificate_of: Callable[[str], str]) -> None:
        self.handshakes: Counter[str] = Counter()
        self._certificate_of = certificate_of
        self._denied: Counter[tuple[str, str]] = Counter()
        self._of_sessions: Counter[tuple[str, str]] = Counter()
        self._latest: dict[bytes, bytes] = {}
        self._strangers: set[str] = set()
        self._rest = b""

    def feed(self, piece: bytes) -> None:
        """Read on in the log: any piece of it, also one that ends within a line."""
        whole, end, rest = piece.rpartition(b"\n")
        if not end:
            self._rest += piece
            return
        lines, self._rest = self._rest + whole, rest
        for found in _LINE.finditer(lines):
            thread, target, said = found.groups()
            if said == _DROPPED:
                self._dropped(_CHECKED.match(self._latest.pop(thread, b"")))
            elif target.startswith(_LINKS):
                self._refused(said)
            else:
                self._latest[thread] = said
                if stranger := _STRANGER.match(said):
                    self._strangers.add(stranger[1].decode())
                    self._denied[UNKNOWN, STRANGER] += 1

    def _refused(self, said: bytes) -> None:
        """Count a connection that was refused, if it was."""
        if why := next((why for text, why in _HANDSHAKES.items() if text in said), ""):
            self.handshakes[why] += 1

    def _dropped(self, checked: re.Match[bytes] | None) -> None:
        """Count a message that was dropped, if it was an attempt; the same thread said before what was ``checked``.

        An answer that comes too late is dropped as well, and not checked. What was allowed has been handed on by then,
        and checked for that; what is too large has not.
        """
        if self._strangers and (checked is None or not checked["no"]):
            self._denied[UNKNOWN, STRANGER] += 1
        elif checked and checked["flow"] == b"ingress" and (checked["no"] or checked["what"] in _LIMITED):
            what = kind_of(checked["what"].decode()) if checked["no"] else SIZE
            self._of_sessions[checked["session"].decode(), what] += 1

    def denied(self) -> Counter[tuple[str, str]]:
        """Messages that were dropped, by certificate and kind: ``put``, ``query``, ``subscriber`` and so on."""
        for session, what in list(self._of_sessions):
            if name := self._certificate_of(session):
                self._denied[name, what] += self._of_sessions.pop((session, what))
        return self._denied + Counter({(UNKNOWN, what): n for (_, what), n in self._of_sessions.items()})


def kind_of(what: str) -> str:
    """One word or two for what the log names, such as ``Declare Liveliness Subscriber``."""
    return what.lower().removeprefix("declare ").removeprefix("undeclare ")
