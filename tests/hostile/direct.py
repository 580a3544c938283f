"""Bad samples given to the parts of a run without a router, some thousands a second.

They get a recorder's listener, a launcher's registry, a centre, a node and a node in its second life. Nothing but the
one error of the wire may be raised, and what remains is a run whose tables and figures can be made. Half of the fields
have a token, as all have that a launcher forks; without one more gets through.
"""

from __future__ import annotations

import logging
import time
import traceback
from collections.abc import Iterator, Sequence
from typing import Any, Final, cast

import msgpack

from launcher.processes.alarms import Alarms
from launcher.processes.registry import Registry
from launcher.record.listener import Listener
from launcher.record.metrics import run_metrics
from launcher.record.tables import track_rows
from launcher.records import Plan
from tests.hostile import field
from tests.hostile.loopback import Loopback, came
from tests.hostile.mixes import HARMLESS, OTHERS
from tests.hostile.samples import Bad, Draw, Means, Sample
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.process import Process
from trackfield.role import NS
from trackfield.wire import keys

LIVES: Final = ("fusion", "n000", "n004~1")
BLOCK: Final = 1000
"""So many samples come to one field."""
AFTER_NS: Final = 10 * NS
"""How long ago (emulated) the run began when it is told to."""
SLOW_S: Final = 30.0
"""What a block may cost at most, in CPU time: no sample may cost a process more than some milliseconds."""


def feed(seed: int, count: int) -> Iterator[str]:
    """A line, with the command that repeats it, for each block of samples that does not end as it should."""
    for block in range(seed, seed + count // BLOCK):
        begun = time.process_time()  # whatever else this machine does meanwhile
        logging.disable(logging.WARNING)  # refusals are logged, and there are many
        try:
            wrong = _block(block)
        finally:
            logging.disable(logging.NOTSET)
        if (spent_s := time.process_time() - begun) > SLOW_S:
            wrong.append(f"{spent_s:.0f} s for {BLOCK} samples")
        for what in wrong[:3]:
            yield f"without a router: python -m tests.hostile --runs 0 --seed {block} --direct {BLOCK}\n  {what}"


def _block(seed: int) -> list[str]:
    """What is wrong after the samples of a seed."""
    draw = Draw(seed)
    plan = field.plan_of(field.TREE_SEED if seed % 3 == 0 else 1)
    draw.known = field.known_of(plan)
    try:
        return Parts(plan, b"a secret" if seed % 2 else b"").attacked(draw)
    except Exception:  # noqa: BLE001  whatever it is, it is what the peer is after
        return [traceback.format_exc(limit=-4)]


class Parts:
    """The parts of a run of this plan in this process, with a ``token`` or without.

    These ``lives`` are given ``kinds`` of samples, as if the run had begun ``after_ns`` (emulated) before.
    """

    def __init__(
        self,
        plan: Plan,
        token: bytes,
        lives: Sequence[str] = LIVES,
        kinds: Sequence[Bad] = (*HARMLESS, *OTHERS),
        after_ns: int = AFTER_NS,
    ) -> None:
        self.kinds, self.after_ns = kinds, after_ns
        self.loopback = Loopback()
        session: Any = cast("Any", self.loopback)
        self.plan = plan
        self.launcher = Seal(token)
        self.registry = Registry(self.plan, Seal(token), Alarms())
        self.registry.declare(session)
        self.listener = Listener(session, self.plan, Seal(token))
        factories = {life.name: life.factory for life in self.plan.processes}
        self.processes = [Process(session, name, factories[name], Seal(token)) for name in lives]

    def attacked(self, draw: Draw) -> list[str]:
        """Bring in a block of samples, most of them after the start, and make the run's tables; what was raised."""
        for i in range(BLOCK):
            if i == BLOCK // 10:
                begun_ns = time.monotonic_ns() - round(self.after_ns / field.SPEED)
                self._order(keys.START, str(begun_ns).encode())
            draw.known.now_ns = self.after_ns if i >= BLOCK // 10 else 0
            sample = draw.choice(self.kinds).sample(draw)
            if sample is not None:
                self.loopback.bring(sample)
                self._arrive(sample)
            if i % 20 == 0:
                self._go_on()
                draw.known.heard.extend(self._delivered())
        self._go_on()
        self._close()
        return self.loopback.raised

    def _order(self, key: str, payload: bytes) -> None:
        order = Sample(key, payload, self.launcher.stamp(key, payload))
        self.loopback.bring(order)
        self._arrive(order)

    def _arrive(self, sample: Sample) -> None:
        """To those that receive through channels."""
        if sample.means in (Means.PUT, Means.DELETE):
            entry: Any = (time.monotonic_ns(), came(sample))
            self.listener._inbox.append(entry)
            for process in self.processes:
                inboxes = tuple(f"data/{medium}/to/{process.spec.id}/" for medium in process.spec.media)
                if process.spec.sink and sample.key.startswith(inboxes):
                    process._inbox.append(entry)

    def _delivered(self) -> list[Sample]:
        """What the parts themselves put, once it has arrived."""
        said, self.loopback.said = self.loopback.said, []
        for sample in said:
            self._arrive(sample)
        return said

    def _go_on(self) -> None:
        """Everybody handles what is due."""
        self.listener.drain()
        for process in self.processes:
            if process._start_ns is None:
                continue
            process._drain()
            for _ in range(50):
                now = time.monotonic_ns()
                if process._work(now) > now:
                    break

    def _close(self) -> None:
        ledger = self.listener.ledger
        ledger.settle(5 * NS)
        self.listener.give_up()
        ledger.close()
        tracks = track_rows(ledger.estimates(), self.plan.paths)
        run_metrics(self.plan, ledger, tracks)
        for process in self.processes:
            msgpack.packb(process.record())
