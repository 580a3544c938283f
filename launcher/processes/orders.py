"""The orders of a launcher to the processes of its run, and whether anybody else gives some or answers in its place."""

from __future__ import annotations

import time

import zenoh
from zenoh.handlers import Callback

from launcher.processes import patience
from launcher.processes.alarms import ANSWERS, ORDERS, Alarms
from trackfield.drivers.exchange.inbox import bytes_of
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.joining.ask import answers, session_of
from trackfield.wire import keys


class Orders:
    """Gives orders and keeps them, to be repeated for processes that may have missed them."""

    def __init__(self, session: zenoh.Session, seal: Seal, alarms: Alarms) -> None:
        self._session, self._seal, self._alarms = session, seal, alarms
        self._given: list[tuple[str, bytes]] = []
        self._arrivals, self._repeat_at, self._probe_at = 0, 0.0, 0.0
        self._own = str(session.info.zid())
        self._held = session.declare_subscriber(keys.ALL_CONTROL, Callback(self._on_order, indirect=False))

    def give(self, key: str, payload: bytes) -> None:
        """Give an order, to all processes and to all groups of them."""
        for one in (key, keys.to_groups(key)):
            self._given.append((one, payload))
            self._put(one, payload)

    def look(self, arrivals: int) -> None:
        """Repeat all orders some time after processes joined or returned (``arrivals`` counts that); look for others.

        To be called often.
        """
        now = time.monotonic()
        if self._arrivals != arrivals:
            self._arrivals, self._repeat_at = arrivals, now + patience.REPEAT_S
        elif self._repeat_at and now > self._repeat_at:
            self._repeat_at = 0.0
            for key, payload in self._given:
                self._put(key, payload)
        if now >= self._probe_at:
            self._probe_at = now + patience.PROBE_S
            for key in (keys.CLAIM, *map(keys.asked_by_all, (keys.CLAIM, keys.JOIN, keys.CONFIRM))):
                answers(self._session, key, b"", patience.PROBE_S, Callback(self._on_answer, indirect=False))

    def _put(self, key: str, payload: bytes) -> None:
        care, stamp = zenoh.CongestionControl.BLOCK, self._seal.stamp(key, payload)
        self._session.put(key, payload, attachment=stamp, congestion_control=care)

    # --- Zenoh's threads ------------------------------------------------------------------------------------------

    def _on_order(self, sample: zenoh.Sample) -> None:
        key, payload, _ = bytes_of(sample)
        if (key, payload) not in self._given:
            self._alarms.add(ORDERS)

    def _on_answer(self, reply: zenoh.Reply) -> None:
        if reply.replier_id is not None and session_of(reply) != self._own:
            self._alarms.add(ANSWERS)
