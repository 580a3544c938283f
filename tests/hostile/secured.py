"""Attacks on secured runs: peers that nobody lets in, and one with the certificate of a node."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Thread
from typing import Any, Final

import zenoh

from launcher.security.attempts import NOBODY, SECOND
from tests.hostile import field as attacked_field
from tests.hostile.attack import SPEEDS, Attack, ended
from tests.hostile.papers import THIEF, WHY, Papers, Shown, papers
from tests.hostile.peer import MARGIN_NS, Attacker, Peer
from tests.hostile.samples import REFUSED, Means, Sample
from tests.hostile.verdicts import Attacked, complaints
from tests.running import METRICS, Run, leftovers, until
from trackfield.drivers.session import open_session
from trackfield.wire import keys

TRY_S: Final = 0.5
"""How long a peer that is not let in tries at a time; a session tries several times meanwhile."""
MESSAGES: Final = {
    Means.PUT: ("put", "put"),
    Means.DELETE: ("delete", "delete"),
    Means.QUERY: ("query", "query"),
    Means.TOKEN: ("liveliness_token", "liveliness token"),
}
"""What rules call a message, and what a run that counts it does."""
SUBSCRIBER: Final = "subscriber"


class Outsider(Attacker):
    """Tries to come in, again and again, as a context manager; ``tries`` are how often, ``came`` whether it did."""

    def __init__(self, settings: str) -> None:
        super().__init__()
        self.tries, self.came = 0, False
        self._settings = settings

    def _attack(self) -> None:
        while not self._over.is_set():
            try:
                open_session(self._settings).close()  # type: ignore[no-untyped-call]
            except zenoh.ZError:
                self.tries += 1
            else:
                self.came = True
                return


class Insider(Peer):
    """Has the certificate of a node, and does what that must not; it stops before the run ends.

    ``forbidden`` counts what it sent, by what a run should call it. What the node may do itself it does only if it is
    to ``pretend``. ``early`` says that the router has had all of it before the end.
    """

    def __init__(self, papers: Papers, endpoint: str, run: str, *arguments: Any, pretend: bool, **more: Any) -> None:
        self.forbidden: Counter[str] = Counter()
        self.allowed: Counter[str] = Counter()
        self.early = False
        self.pretend = pretend
        self._papers, self._run = papers, run
        super().__init__(endpoint, run, *arguments, **more)
        self.forbidden[SUBSCRIBER] += 1

    def _open(self, endpoint: str, run: str) -> zenoh.Session:
        return open_session(self._papers.settings(Shown.NODES, endpoint, run, 60.0))

    def _hears(self) -> tuple[str, ...]:
        return "**", keys.inbox("field", THIEF), keys.ORDERS

    def _on_sample(self, sample: zenoh.Sample) -> None:
        super()._on_sample(sample)
        if str(sample.key_expr) == keys.START:
            self._offset = -int(sample.payload.to_string()) * self._speed

    def _attack(self) -> None:
        Thread(target=self._end_in_time, daemon=True).start()
        super()._attack()
        list(self._session.liveliness().get(f"{keys.LAUNCHER}/*", timeout=30))  # answered after all that was sent
        self.early = self._now_ns() < self._end_ns
        self._tokens.clear()
        with suppress(zenoh.ZError):
            self._session.close()  # type: ignore[no-untyped-call]

    def _now_ns(self) -> int:
        return 0 if self._offset is None else round(time.monotonic_ns() * self._speed + self._offset)

    def _end_in_time(self) -> None:
        while self._now_ns() < self._end_ns - MARGIN_NS and not self._over.wait(0.01):
            pass
        self._over.set()

    def _bring(self, sample: Sample) -> None:
        if (what := self._refused_as(sample)) is not None:
            known = self.repeated
            super()._bring(sample)
            self.forbidden[what] += 1 - (self.repeated - known)
        elif self.pretend or sample.follows == REFUSED:
            super()._bring(sample)
            self.allowed[sample.what] += 1

    def _refused_as(self, sample: Sample) -> str | None:
        """What the router must call it; None if it must let it through."""
        message, what = MESSAGES[sample.means]
        try:
            key = zenoh.KeyExpr(f"{self._run}/{sample.key}")
        except zenoh.ZError:
            return None
        if not any(zenoh.KeyExpr(rule).includes(key) for rule in self._papers.may(THIEF, message)):
            return what
        size = len(sample.payload) + len(sample.attachment or b"")
        limits = self._papers.limits(message)
        return "size" if any(size > most for rule, most in limits if zenoh.KeyExpr(rule).includes(key)) else None


@dataclass(frozen=True)
class Secured:
    """What came of an attack on a secured run: what was tried, what the run counted, and what does not hold."""

    tried: Counter[str] = field(default_factory=Counter)
    allowed: Counter[str] = field(default_factory=Counter)
    attempts: dict[str, dict[str, int]] = field(default_factory=dict)
    wrong: list[str] = field(default_factory=list)
    run: Attacked | None = None
    early: bool = True


def attacked(attack: Attack, shown: Shown, home: Path, *, pretend: bool = False) -> Secured:
    """Attack a secured run by a peer that shows this; ``pretend`` that it speaks in the name of its node, too.

    If the machine does not keep up, the run is repeated at a lower speed.
    """
    certified = papers(attacked_field.plan_of(attack.scenario_seed), home / "papers")
    for speed in SPEEDS:
        found = _once(attack, shown, certified, home / f"run-{speed:g}", speed, pretend)
        if not found.wrong or found.run is None or (found.run.kept_up and found.early):
            break
    return found


def _once(attack: Attack, shown: Shown, certified: Papers, folder: Path, speed: float, pretend: bool) -> Secured:
    arguments = [*attacked_field.arguments(attack.scenario_seed), "--speed", str(speed)]
    run = Run(folder, *arguments, "--secure", "--certificates", str(certified.folder))
    try:
        manifest = until(run.manifest)
        with _peer(attack, shown, certified, manifest, speed, pretend) as peer:
            family = list(run.family().values())
            code, said = run.finish()
    except Exception as error:  # noqa: BLE001  whatever it is, the run did not end as it should
        ended(run)
        return Secured(wrong=[f"{type(error).__name__}: {error}; it said: {run.said()[-500:]}"])
    wrong = [f"left behind: {left}" for left in leftovers(family)]
    if not (folder / METRICS).exists():
        return Secured(wrong=[*wrong, f"no {METRICS}; exit code {code}: {said[-700:]}"])
    metrics = run.metrics()
    found = Attacked(attack.scenario_seed, folder, code, said, metrics, alarming=1, harmful=pretend)
    wrong += complaints(found)
    if isinstance(peer, Insider):
        wrong += _insiders(peer, metrics["attempts"])
        return Secured(peer.forbidden, peer.allowed, metrics["attempts"], wrong, found, peer.early)
    wrong += _outsiders(peer, shown, metrics["attempts"])
    return Secured(Counter({shown.value: peer.tries}), Counter(), metrics["attempts"], wrong, found)


def _peer(
    attack: Attack, shown: Shown, certified: Papers, manifest: dict[str, Any], speed: float, pretend: bool
) -> Insider | Outsider:
    endpoint, name = manifest["endpoint"], manifest["run"]
    if shown is not Shown.NODES:
        return Outsider(certified.settings(shown, endpoint, name, TRY_S))
    plan = attacked_field.plan_of(attack.scenario_seed)
    known = attacked_field.known_of(plan)
    timing = {"seed": attack.seed, "speed": speed, "end_ns": plan.run.end_ns, "rate": attack.rate}
    return Insider(certified, endpoint, name, known, attack.mix, pretend=pretend, **timing)


def _outsiders(peer: Outsider, shown: Shown, attempts: dict[str, dict[str, int]]) -> Iterator[str]:
    """Each try was seen, under its own name, and nothing else was."""
    if peer.came:
        yield f"a peer with {shown.value} was let in"
    counted = attempts.get(NOBODY, {})
    if set(attempts) != {NOBODY} or set(counted) != {WHY[shown]}:
        yield f"counted {attempts}, not only certificates: {WHY[shown]}"
    if not 0 < peer.tries <= counted.get(WHY[shown], 0) + 1:  # the last one may come after the end
        yield f"{peer.tries} tries, {counted} counted"


def _insiders(peer: Insider, attempts: dict[str, dict[str, int]]) -> Iterator[str]:
    """Each message was counted, by its kind, and the second session."""
    if attempts != {THIEF: {**peer.forbidden, SECOND: 1}}:
        late = "" if peer.early else " (not all before the end)"
        yield f"sent {dict(peer.forbidden)}, counted {attempts}{late}"
