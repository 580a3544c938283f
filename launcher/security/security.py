"""How a run is secured: certificates made for it now, or those in a folder that were made before."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

from launcher.records import LAUNCHER, RECORDER, ROUTER, Plan
from launcher.security.access import TOOLS, rules
from launcher.security.authority import Authority, lifetime_s
from launcher.security.folder import RULES, Facts, check_new, checked_in, facts_of, is_empty, missing, rules_in, write
from launcher.security.limits import limits
from launcher.security.options import CERTIFICATES
from trackfield.drivers.session import Credentials
from trackfield.errors import ScenarioError
from trackfield.role import NS
from trackfield.wire import keys

MOST_TOLD: Final = 5
"""Of more names without certificates, so many are told."""


@dataclass(frozen=True, slots=True)
class Security:
    """The certificates of a run by name, and further settings of its router by their paths."""

    issue: Callable[[str], Credentials]
    settings: Mapping[str, Any]
    _issued: dict[str, Credentials] = field(default_factory=dict)

    def credentials(self, name: str) -> Credentials:
        """Those of a process, of all its lives, or of another part of the run. Raises ``ScenarioError``."""
        if name not in self._issued:
            self._issued[name] = self.issue(name)
        return self._issued[name]

    @property
    def slices(self) -> int:
        """For how many slices of the field the router has rules."""
        return sum(one["id"].startswith(keys.slice_name(0)[:-1]) for one in self.settings["access_control"]["subjects"])


@dataclass(frozen=True, slots=True)
class Wanted:
    """What certificates are to be like: valid for so many ``days`` (None: ``lifetime_s``), with the router at these
    ``hosts`` beside this machine, under the authority in the folder ``ca``, for slices with these ``blocks`` of ids.
    """

    hosts: tuple[str, ...] = ()
    ca: Path | None = None
    days: float | None = None
    blocks: Sequence[Collection[str]] = ()


def made(plan: Plan, wanted: Wanted) -> tuple[Security, Authority]:
    """A security of its own for a run, which is nowhere but here. Raises ``ScenarioError``."""
    run = plan.run.run
    settings = {
        "access_control": rules(run, plan.processes, wanted.blocks),
        **limits(run, plan.processes, len(wanted.blocks)),
    }
    authority = Authority(run, lifetime_s(_length_s(plan), wanted.days), wanted.hosts, wanted.ca)
    return Security(authority.issue, settings), authority


def made_in(folder: Path, plan: Plan, wanted: Wanted, key: str = CERTIFICATES) -> Security:
    """The same, also written to a folder, which the option ``key`` names, for others. Raises ``ScenarioError``."""
    security, authority = made(plan, wanted)
    names = [*TOOLS, *sorted(plan.ids), *(keys.slice_name(n) for n in range(1, len(wanted.blocks) + 1))]
    expires = authority.expires.isoformat(timespec="seconds")
    facts = Facts(plan.run.run, plan.info.scenario, plan.run.seed, expires)
    write(folder, facts, {name: security.credentials(name) for name in names}, security.settings, key)
    return security


def kept_in(folder: Path, plan: Plan, *, router: bool = True) -> Security:
    """The security in a folder that was made for this run, which has a ``router`` of its own or not.

    Raises ``ScenarioError``.
    """
    facts, settings = facts_of(folder, CERTIFICATES), rules_in(folder, CERTIFICATES)
    names = [LAUNCHER, RECORDER, *([ROUTER] if router else []), *sorted(plan.ids)]
    if what := _foreign(folder, facts, plan, names, settings["access_control"]):
        expected = "a folder that trackfield certificates made for this run, with the same options"
        raise ScenarioError(what, file=str(folder), key=CERTIFICATES, expected=expected)
    security = Security(lambda name: checked_in(folder, name, CERTIFICATES), settings)
    for name in names:  # all that is wrong is said before the run
        security.credentials(name)
    return security


def _foreign(folder: Path, facts: Facts, plan: Plan, names: Sequence[str], access: Mapping[str, Any]) -> str:
    """Why the certificates in a folder do not do for a run with these ``names``, or nothing."""
    if (facts.scenario, facts.seed) != (plan.info.scenario, plan.run.seed):
        return f"is for {facts.scenario} with seed {facts.seed}, not {plan.info.scenario} with seed {plan.run.seed}"
    if none := missing(folder, names):
        return f"has no certificate and key of {', '.join(none[:MOST_TOLD])}{' ...' if len(none) > MOST_TOLD else ''}"
    if not _said(rules(facts.run, plan.processes)) <= _said(access):
        return f"lets processes do other things, in {RULES}, than they do in this run"
    if datetime.now(UTC) + timedelta(seconds=_length_s(plan)) >= datetime.fromisoformat(facts.expires):
        return f"holds certificates that expire at {facts.expires}, before this run could end"
    return ""


def _said(access: Mapping[str, Any]) -> set[str]:
    """What rules allow, whatever they are called."""
    return {json.dumps([rule.get(part) for part in ("flows", "messages", "key_exprs")]) for rule in access["rules"]}


def secured(plan: Plan, folder: Path | None, hosts: tuple[str, ...], ca: Path | None, *, router: bool) -> Security:
    """The security of a run: that in the folder, which is made if it is empty, or without one its own.

    ``router`` says that the run has one of its own. Raises ``ScenarioError``.
    """
    wanted = Wanted(hosts, ca)
    if folder is None:
        return made(plan, wanted)[0]
    if not is_empty(folder):
        return kept_in(folder, plan, router=router)
    check_new(folder, CERTIFICATES)
    return made_in(folder, plan, wanted)


def named_in(plan: Plan, folder: Path | None) -> Plan:
    """The plan under the id of the run for which a folder holds certificates, if it does. Raises ``ScenarioError``."""
    if folder is None or is_empty(folder):
        return plan
    run = facts_of(folder, CERTIFICATES).run
    return replace(plan, run=replace(plan.run, run=run), info=replace(plan.info, run=run))


def _length_s(plan: Plan) -> float:
    """How long (s of real time) a run takes."""
    return plan.run.end_ns / NS / plan.run.speed
