"""Who has which place in a run, and who is there: answers all who ask at ``control/join``, early or late."""

from __future__ import annotations

from dataclasses import asdict, replace

import msgpack
import zenoh
from zenoh.handlers import Callback

from launcher.records import Plan
from trackfield.drivers.spec import ProcessSpec
from trackfield.wire import keys


class Registry:
    """The lives of a run by name, planned and made on the way.

    ``run`` is what all share, ``start_ns`` the host's monotonic time at which emulated time began (None: not yet),
    ``live`` the names of those that are there as Zenoh sees it, ``arrivals`` how often one came (back).
    """

    def __init__(self, plan: Plan) -> None:
        self.run = plan.run
        self.start_ns: int | None = None
        self.live: set[str] = set()
        self.arrivals = 0
        self._lives = {p.name: p for p in plan.processes}
        self._stored: dict[str, bytes] = {}

    def declare(self, session: zenoh.Session) -> None:
        """Answer and listen from now on, for as long as the session is open."""
        self._held = [
            session.declare_queryable(keys.JOIN, Callback(self._answer, indirect=False)),
            session.declare_subscriber(keys.telemetry_of_all("stored"), Callback(self._on_stored, indirect=False)),
            session.liveliness().declare_subscriber(
                keys.ALL_LIVE, Callback(self._on_live, indirect=False), history=True
            ),
        ]

    def end(self, end_ns: int) -> None:
        """The run ends early, at this emulated time: whoever joins later must know it."""
        self.run = replace(self.run, end_ns=end_ns)

    def next_life(self, name: str, start_ns: int) -> ProcessSpec:
        """A place for whoever comes after the life ``name``, from this emulated time on to that life's planned end."""
        last = self._lives[name]
        incarnation = 1 + max(p.incarnation for p in self._lives.values() if p.id == last.id)
        life = replace(last, incarnation=incarnation, start_ns=start_ns)
        self._lives[life.name] = life
        return life

    # --- Zenoh's threads ------------------------------------------------------------------------------------------

    def _answer(self, query: zenoh.Query) -> None:
        name = query.payload.to_string() if query.payload else ""
        life = self._lives.get(name)
        if life is None:
            query.reply_err(f"no process {name!r} in this run")
            return
        answer = {
            "run": asdict(self.run),
            "process": life.plain(),
            "start_ns": self.start_ns,
            "stored": self._stored.get(life.id, b""),
        }
        query.reply(query.key_expr, msgpack.packb(answer))

    def _on_stored(self, sample: zenoh.Sample) -> None:
        name = str(sample.key_expr).split("/")[1]
        self._stored[keys.id_of(name)] = sample.payload.to_bytes()

    def _on_live(self, sample: zenoh.Sample) -> None:
        name = str(sample.key_expr).rpartition("/")[2]
        if sample.kind == zenoh.SampleKind.PUT:
            self.live.add(name)
            self.arrivals += 1
        else:
            self.live.discard(name)
