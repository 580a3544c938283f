"""The places of a run and the processes that are alive: answers all that ask for their place, early or late."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, replace
from threading import Lock
from typing import Any, Final

import zenoh
from zenoh.handlers import Callback

from launcher.processes.alarms import QUESTIONS, TOKENS, Alarms
from launcher.processes.places.tickets import LENGTH, Tickets
from launcher.records import LIVE, RECORDER, Plan
from trackfield.drivers.exchange.intake import opened, printable, read, unpacked
from trackfield.drivers.exchange.seal import TOKEN, Seal
from trackfield.drivers.joining.ask import REFUSED, UNSEALED, answer, question_of
from trackfield.drivers.joining.join import token
from trackfield.drivers.joining.tokens import tokens
from trackfield.drivers.spec import ProcessSpec
from trackfield.wire import keys
from trackfield.wire.error import WireError

RECORDERS: Final = (RECORDER, LIVE)
"""They do not join: the launcher tells them all."""
REFRESH_TIMEOUT_S: Final = 2.0
AGAIN_S: Final = 0.1
"""How long after a question in whose answer somebody is missing it is asked again."""
NO_SEAL: Final = f"the question lacks the seal of this run: set {TOKEN} as it is set for the launcher"

NO_PLACES: Final = (
    "the launcher starts all processes of this run: it gives places with --external, --field or run.external"
)


class Registry:
    """The lives of a run by name, planned ones and those added during the run.

    ``run`` is common to all, ``start_ns`` the host's monotonic time at which emulated time began (None: not yet),
    ``live`` the names of those that joined and are alive as Zenoh sees it, ``arrivals`` how often one joined or
    returned, ``hosts`` the host of each that told it.
    """

    def __init__(self, plan: Plan, seal: Seal, alarms: Alarms) -> None:
        self.run, self._seal, self._alarms = plan.run, seal, alarms
        self._told_run = asdict(plan.run)
        self.start_ns: int | None = None
        self.live: set[str] = set()
        self.arrivals = 0
        self.hosts: dict[str, str] = {}
        self._lives = {p.name: p for p in plan.processes}
        self._told: dict[tuple[str, str], bytes] = {}  # by the id, and whether it is "stored" or "spent"
        self._unplanned: set[str] = set()
        self._tickets = Tickets()
        self._holds: dict[str, str] = {}  # the ticket of the process that lives, or lived last, under each name
        self._own = ""
        self._lock = Lock()

    def declare(self, session: zenoh.Session) -> None:
        """Answer and listen from now on, for as long as the session is open."""
        self._own = keys.launcher(session.info.zid())
        liveliness = session.liveliness()
        launchers = f"{keys.LAUNCHER}/*"
        on_told = Callback(self._on_told, indirect=False)
        self._held = [
            session.declare_queryable(keys.asked_by_all(keys.JOIN), Callback(self._on_join, indirect=False)),
            session.declare_queryable(keys.CLAIM, Callback(self._on_claim, indirect=False)),
            *self._more(session),
            *(session.declare_subscriber(keys.telemetry_of_all(what), on_told) for what in ("stored", "spent")),
            liveliness.declare_subscriber(keys.ALL_LIVE, Callback(self._on_live, indirect=False), history=True),
            liveliness.declare_subscriber(launchers, Callback(self._on_launcher, indirect=False), history=True),
            # last: processes that see it may ask at once
            liveliness.declare_token(self._own),
        ]

    def _more(self, session: zenoh.Session) -> list[Any]:
        """What else is declared."""
        questions = keys.SLICE, keys.asked_by_all(keys.CLAIM)
        return [session.declare_queryable(key, Callback(self._on_claim, indirect=False)) for key in questions]

    def end(self, end_ns: int) -> None:
        """The run ends early, at this emulated time; processes that join later are told so."""
        self.run = replace(self.run, end_ns=end_ns)
        self._told_run = asdict(self.run)

    def next_life(self, name: str, start_ns: int) -> ProcessSpec:
        """The life after the life ``name``, from this emulated time to the planned end of that one."""
        life = self._following(name, start_ns)
        self._lives[life.name] = life
        self._unplanned.add(life.name)
        return life

    def _following(self, name: str, start_ns: int) -> ProcessSpec:
        last = self._lives[name]
        incarnation = 1 + max(p.incarnation for p in self._lives.values() if p.id == last.id)
        return replace(last, incarnation=incarnation, start_ns=start_ns)

    def refresh(self, session: zenoh.Session) -> None:
        """Ask which processes are alive: notice of an end, or of a return, may have been lost on its way.

        Zenoh's answer may lack tokens while some session closes (they come as notices afterwards): who is missing is
        asked for twice, and comes back when asked for later.
        """
        known = {name: self._holds[name] for name in set(self.live)}
        there = self._tokens(session)
        if any(self._token(*one) not in there for one in known.items()):
            time.sleep(AGAIN_S)
            again = self._tokens(session)
            there = there | again if again else again
        for name, ticket in list(self._holds.items()) if there else ():
            is_there = self._token(name, ticket) in there
            if is_there and name not in known:
                self._returned(name, ticket)
            elif not is_there and known.get(name) == ticket:
                self._went(name, ticket)

    @staticmethod
    def _tokens(session: zenoh.Session) -> set[str]:
        """The keys of all tokens that are told; none if some may be missing as the answer took too long."""
        found = tokens(session, keys.ALL_LIVE, REFRESH_TIMEOUT_S)
        return set(found.keys) if found.all else set()

    # --- what differs if processes are started elsewhere ----------------------------------------------------------

    def _life(self, name: str, now_ns: int) -> ProcessSpec:
        """The life of a process that joins under this name now (monotonic). Raises ``LookupError`` if it may not."""
        if name not in self._lives:
            raise LookupError(f"no process {printable(name)} in this run")
        return self._lives[name]

    def _admit(self, name: str, given_ns: int) -> bool:
        """Whether a process that shows a ticket of this time has the place of this name; under the lock."""
        return name in self._lives and name not in self.live

    def _here(self, name: str) -> None:
        """The process of this name is there, for the first time or again; under the lock."""

    def _left(self, name: str) -> None:
        """The process of this name is gone; under the lock."""

    # --- Zenoh's threads: questions -------------------------------------------------------------------------------

    def _on_join(self, query: zenoh.Query) -> None:
        self.reply(query, 1, self._join)

    def _on_claim(self, query: zenoh.Query) -> None:
        """Give no place, to nobody, which needs no seal."""
        with suppress(zenoh.ZError):
            answer(query, str(query.key_expr), {REFUSED: NO_PLACES}, self._seal)

    def reply(self, query: zenoh.Query, count: int, tell: Callable[..., dict[str, Any]], about: int = 0) -> None:
        """Answer with what ``tell`` makes of the ``count`` texts of a question, or say why not.

        At a key of its own a process asks about itself alone: that text which is ``about`` it. A question to many gets
        no answer.
        """
        key = str(query.key_expr)
        if "*" in key:
            return
        told: dict[str, Any]
        try:
            texts = read(_texts, question_of(query, key, self._seal), count)
            if key not in keys.BY_ANYBODY and keys.id_of(texts[about]) != key.rpartition("/")[2]:
                raise WireError("key", "a question in another's name")
            told = tell(*texts)
        except LookupError as error:
            told = {REFUSED: str(error)}
        except WireError as error:
            told = {REFUSED: str(error)}
            if error.reason == "seal":
                told = {REFUSED: NO_SEAL, UNSEALED: True}
                self._alarms.add(QUESTIONS)
        with suppress(zenoh.ZError):  # who asked is gone
            answer(query, key, told, self._seal)

    def _join(self, name: str) -> dict[str, Any]:
        now_ns = time.monotonic_ns()
        life = self._life(name, now_ns)
        taken_over = life.name in self._unplanned or life.name not in self._lives
        return {
            "run": self._told_run,
            "process": life.plain(),
            "start_ns": self.start_ns,
            "stored": self._told.get((life.id, "stored"), b"") if taken_over else None,
            "spent": self._told.get((life.id, "spent"), b"") if taken_over else b"",
            "ticket": self._tickets.give(name, now_ns),
        }

    # --- Zenoh's threads: tokens, and what processes store --------------------------------------------------------

    def _on_told(self, sample: zenoh.Sample) -> None:
        with suppress(WireError):  # the recorder counts it
            name, what = keys.parse_telemetry(str(sample.key_expr))
            told = opened(sample, self._seal)
            if name in self._lives:
                self._told[keys.id_of(name), what] = told

    def _on_launcher(self, sample: zenoh.Sample) -> None:
        if sample.kind == zenoh.SampleKind.PUT and str(sample.key_expr) != self._own:
            self._alarms.add(TOKENS)

    def _on_live(self, sample: zenoh.Sample) -> None:
        there = sample.kind == zenoh.SampleKind.PUT
        key = str(sample.key_expr)
        name, ticket = self._parts(key)
        try:
            known = key == self._token(name, ticket) and (there or self._holds.get(name) == ticket)
            given_ns = 0 if name in RECORDERS else self._tickets.given_ns(name, ticket)
        except WireError:
            known = False
        if not there:
            if known:
                self._went(name, ticket)
        elif not known or not self._came(name, ticket, given_ns):
            self._alarms.add(TOKENS)

    @staticmethod
    def _parts(key: str) -> tuple[str, str]:
        """Whose token this is, and its ticket; the recorders have none."""
        name, _, mark = key.partition("/")[2].partition("/")
        return name, "" if name in RECORDERS else mark[:LENGTH]

    def _token(self, name: str, ticket: str) -> str:
        """The key of the token of this life. Raises ``WireError`` if it is no name."""
        return token(name, ticket, self._seal)

    def _came(self, name: str, ticket: str, given_ns: int) -> bool:
        """Note that a process of the run is there; False if it should not be."""
        with self._lock:
            new = name not in RECORDERS and self._holds.get(name) != ticket
            if new and not self._admit(name, given_ns):
                return self._was_late(name, given_ns)
            self._holds[name] = ticket
            self._add(name)
            return True

    def _was_late(self, name: str, given_ns: int) -> bool:
        """Whether a process that was not admitted may have come by mistake, and will leave; under the lock."""
        return False

    def _returned(self, name: str, ticket: str) -> None:
        """Note that the process that lived last under this name is there after all."""
        with self._lock:
            if self._holds.get(name) == ticket:
                self._add(name)

    def _add(self, name: str) -> None:
        """Note that a process is there; under the lock."""
        self.live.add(name)
        self._here(name)
        self.arrivals += 1

    def _went(self, name: str, ticket: str) -> None:
        with self._lock:
            if self._holds.get(name) == ticket and name in self.live:
                self.live.discard(name)
                self._left(name)


def _texts(question: bytes, count: int) -> list[str]:
    """The texts of a question; the bytes at its end only make it different from all others."""
    *texts, nonce = unpacked(question)
    if type(nonce) is not bytes or len(texts) != count or not all(type(text) is str for text in texts):
        raise WireError("malformed", "no question")
    return list(map(str, texts))
