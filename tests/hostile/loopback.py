"""A Zenoh session without a network: what is put in comes out at once, in the same thread.

It has what processes, registries and recorders use of a session. Zenoh prints what a callback raises and goes on; here
it is kept, as it must not happen.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, Final, Self

import zenoh
from zenoh.handlers import Callback

from tests.hostile.samples import Means, Sample

ZID: Final = "c0ffee"


@dataclass(frozen=True)
class Came:
    """A sample as a subscriber gets it."""

    key_expr: str
    payload: zenoh.ZBytes
    attachment: zenoh.ZBytes | None
    kind: zenoh.SampleKind


def came(sample: Sample) -> Came:
    attachment = None if sample.attachment is None else zenoh.ZBytes(sample.attachment)
    kind = zenoh.SampleKind.DELETE if sample.means is Means.DELETE else zenoh.SampleKind.PUT
    return Came(sample.key, zenoh.ZBytes(sample.payload), attachment, kind)


@dataclass
class Query:
    """A question, and the answers to it so far."""

    key_expr: str
    payload: zenoh.ZBytes
    attachment: zenoh.ZBytes | None = None
    replies: list[Any] = field(default_factory=list)

    def reply(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        ok = came(Sample(key, payload, attachment))
        self.replies.append(SimpleNamespace(ok=ok, err=None, replier_id=SimpleNamespace(zid=ZID)))


@dataclass
class Loopback:
    """A session with its declarations; ``said`` is what its users put, ``raised`` what callbacks raised."""

    raised: list[str] = field(default_factory=list)
    said: list[Sample] = field(default_factory=list)
    _subscribers: list[tuple[zenoh.KeyExpr, Callable[[Any], object]]] = field(default_factory=list)
    _queryables: list[tuple[zenoh.KeyExpr, Callable[[Any], object]]] = field(default_factory=list)
    _watchers: list[tuple[zenoh.KeyExpr, Callable[[Any], object]]] = field(default_factory=list)
    _tokens: list[str] = field(default_factory=list)

    info: Any = field(default_factory=lambda: SimpleNamespace(zid=lambda: ZID))

    def declare_subscriber(self, key: str, handler: Any, **_: Any) -> Any:
        """One with a channel is fed by the test itself: the thread that would empty it ends at once."""
        if isinstance(handler, Callback):
            self._subscribers.append((zenoh.KeyExpr(key), handler.callback))
        return self

    def declare_queryable(self, key: str, handler: Any, **_: Any) -> Any:
        self._queryables.append((zenoh.KeyExpr(key), handler.callback))
        return self

    def recv(self) -> Any:
        raise zenoh.ZError("there is no channel")

    def put(self, key: str, payload: bytes, *, attachment: bytes | None = None, **_: Any) -> None:
        self.said.append(Sample(key, payload, attachment))
        self.bring(self.said[-1])

    def get(
        self, key: str, handler: Any = None, *, payload: bytes = b"", attachment: bytes | None = None, **_: Any
    ) -> None:
        query = Query(key, zenoh.ZBytes(payload), None if attachment is None else zenoh.ZBytes(attachment))
        self._call(self._queryables, key, query)
        if handler is not None:
            for reply in query.replies:
                handler.callback(reply)
            if handler.drop:
                handler.drop()

    def close(self) -> None:
        """Nothing to close."""

    # --- liveliness -----------------------------------------------------------------------------------------------

    def liveliness(self) -> Any:
        return SimpleNamespace(
            declare_token=self._declare_token, declare_subscriber=self._watch_tokens, get=self._get_tokens
        )

    def _declare_token(self, key: str) -> Self:
        self._tokens.append(key)
        self._call(self._watchers, key, came(Sample(key)))
        return self

    def _watch_tokens(self, key: str, handler: Any, **_: Any) -> Self:
        self._watchers.append((zenoh.KeyExpr(key), handler.callback))
        return self

    def _get_tokens(self, key: str, handler: Any, **_: Any) -> None:
        asked = zenoh.KeyExpr(key)
        for token in self._tokens:
            if asked.intersects(zenoh.KeyExpr(token)):
                handler.callback(SimpleNamespace(ok=came(Sample(token)), err=None))
        handler.drop()

    # --- what a peer does -----------------------------------------------------------------------------------------

    def bring(self, sample: Sample) -> None:
        """Bring in a sample, by whatever means."""
        match sample.means:
            case Means.QUERY:
                self.get(sample.key, payload=sample.payload)
            case Means.TOKEN:
                self._call(self._watchers, sample.key, came(sample))
            case _:
                self._call(self._subscribers, sample.key, came(sample))

    def _call(self, who: list[tuple[zenoh.KeyExpr, Callable[[Any], object]]], key: str, what: object) -> None:
        try:
            at = zenoh.KeyExpr(key)
        except zenoh.ZError:
            return  # no router takes it
        for wanted, callback in who:
            if wanted.intersects(at):
                try:
                    callback(what)
                except Exception:  # noqa: BLE001  whatever it is, it must not be
                    self.raised.append(traceback.format_exc(limit=-3))
