"""What a slice asks of the launcher, and the processes that it is given."""

from __future__ import annotations

import os
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import msgpack
import zenoh

from launcher.blocks import number_of
from launcher.processes.places.desk import AUTO, TAKEN
from launcher.processes.places.slices import CONFIRM, JOIN, LEAVE, LIVE, own_version
from launcher.slices.roles import factory, own_places
from trackfield.drivers.exchange.intake import Refusals, printable, read
from trackfield.drivers.exchange.seal import Seal
from trackfield.drivers.joining.ask import ANSWER_TIMEOUT_S, JoinError, ask
from trackfield.drivers.joining.credentials import GUEST, credentials_in
from trackfield.drivers.joining.join import LOOK_S, NONCE_BYTES
from trackfield.drivers.session import Credentials
from trackfield.drivers.spec import ProcessSpec
from trackfield.errors import ScenarioError
from trackfield.wire import keys
from trackfield.wire.error import WireError

_SHARE: Final = re.compile(rf"([0-9]{{1,6}}|{AUTO})/([1-9][0-9]{{0,5}})")


class TakenError(JoinError):
    """There is no such slice to have now; there may be one later."""


@dataclass(frozen=True, slots=True)
class Share:
    """What ``--slice`` says: which of how many, counted from 0 or from 1, or ``auto``."""

    which: str
    of: str

    @classmethod
    def parse(cls, text: str) -> Share:
        """Raises ``ScenarioError`` unless this is I/N or auto/N."""
        if found := _SHARE.fullmatch(text):
            return cls(*found.groups())
        raise ScenarioError(f"is {text!r}", key="--slice", expected="I/N, like 3/8 or 0/8, or auto/8 for any")

    def credentials(self, folder: Path | None) -> Credentials | None:
        """Those in this folder: its own, or by which it gets its own. None without one. Raises ``ScenarioError``."""
        if folder is None:
            return None
        number = 0 if self.which == AUTO else number_of(int(self.which), int(self.of))
        own = keys.slice_name(number)
        return credentials_in(folder, own if (folder / f"{own}.pem").exists() else GUEST)


@dataclass(frozen=True, slots=True)
class Given:
    """The share of a run's field that this host has: the planned ``lives`` of its processes, and how to run them.

    ``places`` are those of users' own classes. The rest is what is known of the run: when it started by the run's clock
    (ns; None: not yet), when it ends (emulated ns), how fast it is, and whether processes that die are to be replaced.
    """

    run: str
    scenario: str
    number: int
    of: int
    ticket: str
    lives: tuple[ProcessSpec, ...]
    places: Mapping[str, str]
    start_ns: int | None
    end_ns: int
    speed: float
    restart: bool
    credentials: Credentials | None = None

    @property
    def text(self) -> str:
        """As messages name it."""
        return f"slice {self.number}/{self.of}"


class Asking:
    """Asks the launcher of ``run``, as a slice on this ``host``."""

    def __init__(self, run: str, host: str, seal: Seal) -> None:
        self.run, self.host, self.seal = run, host, seal
        self.refused = Refusals()

    def join(self, session: zenoh.Session, share: Share, shown: Credentials | None = None) -> Given:
        """The share of this slice, which has ``shown`` these certificates, its own or those of a guest.

        Raises ``RefusedError`` if it can never have one, ``TakenError`` if it cannot now, ``JoinError`` if no launcher
        answers, ``ScenarioError`` for classes that are not known here.
        """
        told = self._ask(session, JOIN, share.which, share.of)
        try:
            given = read(_given, self.run, told)
            return given if shown is None else replace(given, credentials=read(_certified, shown, told))
        except WireError as error:
            raise JoinError(f"what the launcher tells is no share of a field: {error}") from None

    def confirm(self, session: zenoh.Session, given: Given) -> None:
        """Wait until the launcher has seen the token of this slice. Raises ``JoinError`` if another has its place."""
        deadline = time.monotonic() + ANSWER_TIMEOUT_S
        while time.monotonic() < deadline:
            if self._about(session, CONFIRM, given).get(LIVE) is True:
                return
            time.sleep(LOOK_S)
        raise JoinError(f"the launcher does not see {given.text}")

    def leave(self, session: zenoh.Session, given: Given) -> None:
        """Say goodbye. Raises ``JoinError``."""
        self._about(session, LEAVE, given)

    def token(self, given: Given) -> str:
        """The key of the liveliness token of this slice."""
        mark = self.seal.mark(keys.slice_token(given.number, given.of, given.ticket))
        return keys.slice_token(given.number, given.of, given.ticket + mark)

    def _about(self, session: zenoh.Session, word: str, given: Given) -> dict[str, Any]:
        return self._ask(session, word, str(given.number), str(given.of), given.ticket)

    def _ask(self, session: zenoh.Session, word: str, which: str, of: str, ticket: str = "") -> dict[str, Any]:
        question = [word, which, of, self.host, own_version(), ticket, os.urandom(NONCE_BYTES)]
        told = ask(session, keys.SLICE, msgpack.packb(question), self.seal, self.refused)
        if TAKEN in told:
            raise TakenError(printable(told[TAKEN]))
        return told


def _given(run: str, told: Mapping[str, Any]) -> Given:
    """The share that the launcher tells of. Raises ``ScenarioError``, and whatever is wrong with its answer."""
    sensors = [_sensor(*one) for one in told["sensors"]]
    whole = told["number"], told["of"], told["end_ns"]
    if not all(type(one) is int for one in whole) or type(told["start_ns"]) not in (int, type(None)):
        raise WireError("malformed", "no numbers")
    if not str(told["ticket"]).isalnum():
        raise WireError("malformed", "no ticket")
    return Given(
        run,
        printable(told["scenario"]),
        told["number"],
        told["of"],
        told["ticket"],
        tuple(_life(sensors, *life) for life in told["lives"]),
        own_places(told["own"]),
        told["start_ns"],
        told["end_ns"],
        float(told["speed"]),
        told["restart"] is True,
    )


def _certified(shown: Credentials, told: Mapping[str, Any]) -> Credentials:
    """The slice's own. Raises ``WireError`` if the launcher gives none."""
    certificate, key = told.get("certificate"), told.get("key")
    if type(certificate) is not str or type(key) is not str:
        raise WireError("malformed", "no certificates: its run is not secured (--secure)")
    return Credentials(shown.authority, certificate, key)


def _life(
    sensors: list[dict[str, Any]], name: str, role: str, sink: bool, kill_ns: int | None, which: int | None
) -> ProcessSpec:
    """As much of a life as it takes to start it."""
    id, _, number = keys.check_name(name).partition("~")
    sound = {} if which is None else sensors[which]
    incarnation = int(number or 0)
    return ProcessSpec(id, role, factory(role), sound=sound, incarnation=incarnation, sink=sink, kill_ns=kill_ns)


def _sensor(kind: str, options: Mapping[str, Any], recorded: bool) -> dict[str, Any]:
    return {"kind": kind, "options": dict(options), **({"times": ()} if recorded else {})}
