"""What the processes on a field are made by: a slice is told the names of roles only, never where a class is."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

from trackfield.drivers.spec import factory_of
from trackfield.errors import ScenarioError
from trackfield.plugins import Plugins

ROLES: Final[Mapping[str, str]] = {
    "node": "node.role:Node",
    "slave": "node.slave:Slave",
    "master": "head.master:Master",
    "peer": factory_of({"member": "node.member:Member", "header": "head.header:Header"}),
    "ear": factory_of({"ear": "node.ear:Ear", "hearing": "head.hearing.role:Hearing"}),
}
"""The factory of each role that stands on a field of Trackfield's own architectures."""


def factory(role: str) -> str:
    """The factory of this role. Raises ``ScenarioError`` for one of a user's own architecture."""
    if role not in ROLES:
        what = "is a role of another architecture than Trackfield's own, which a slice does not know"
        expected = "its processes started one by one: python -m trackfield.drivers.standalone"
        raise ScenarioError(what, key=f"role '{role}'", expected=expected)
    return ROLES[role]


def own_places(names: Iterable[str]) -> dict[str, str]:
    """Where the trackers and sensors of these names (``kind:name``) are, which users made, among installed packages.

    Raises ``ScenarioError`` for those that are not installed here.
    """
    return {which: _table(which).place(which.partition(":")[2]) for which in names if _installed(which)}


def _installed(which: str) -> bool:
    kind, _, name = which.partition(":")
    if name not in _table(which):
        what = f"this run needs the {kind} '{name}', a class of a user's own that is not installed on this host"
        raise ScenarioError(what, key="--slice", expected="the package with it installed here, too")
    return True


def _table(which: str) -> Plugins:
    if which.startswith("sensor:"):
        from trackfield.sensing.kinds import SENSORS

        return SENSORS
    from trackfield.filters.trackers import TRACKERS

    return TRACKERS
