"""Checks of the options of a run, alone and together."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, Final

from trackfield.drivers.session import PROTOCOLS, is_endpoint
from trackfield.errors import ScenarioError, combined

if TYPE_CHECKING:
    from launcher.records import Plan

INSIDE: Final = {
    "container-kill": "kill",
    "container-restart": "restart",
    "container-pause": "freeze",
    "container-disconnect": "partition",
}
"""The fault of a process, in any run, that is most like that of a container."""
EXTERNAL: Final = "external"
"""What ``--field`` may be."""


def check_endpoint(endpoint: str, option: str) -> None:
    """Raise ``ScenarioError`` unless this can be where a Zenoh router listens."""
    if not is_endpoint(endpoint):
        expected = f"PROTOCOL/ADDRESS, like tcp/127.0.0.1:7447 (protocols: {', '.join(PROTOCOLS)})"
        raise ScenarioError(f"is {endpoint!r}", key=option, expected=expected)


def check_driver(
    *,
    virtual: bool,
    external: bool,
    live: str = "",
    connect: str,
    speed: float | None,
    field: str = "",
    wait_s: float | None = None,
    listen: bool = False,
    bridged: str = "",
) -> None:
    """Raise ``ScenarioError`` with all options that contradict others, or have no effect beside them.

    ``bridged`` is the option that puts a real device in the place of a process, or empty.
    """
    if field not in ("", EXTERNAL):
        raise ScenarioError(f"is {field!r}", key="--field", expected=f"--field {EXTERNAL}")
    guests = "--external" if external else "--field" if field else ""
    viewed = "it without --virtual, or the timeline afterwards: trackfield view RUN"
    alone = "it without --virtual"
    rules = (
        (bool(guests) and virtual, guests, "there are no processes in virtual time", alone),
        (external and bool(field), "--field", "with --external all processes start elsewhere", "one of the two"),
        (bool(live) and virtual, live, "a run in virtual time is over at once", viewed),
        (speed is not None and virtual, "--speed", "virtual time goes as fast as the machine can", alone),
        (bool(bridged) and virtual, bridged, "there is no device in virtual time", alone),
        (bool(bridged) and bool(guests), bridged, "the processes start elsewhere", f"it without {guests}"),
        (bool(bridged) and speed not in (None, 1), bridged, "a device goes by the wall clock", "it with --speed 1"),
        (bool(connect) and virtual, "--connect", "a run in virtual time uses no router", alone),
        (listen and virtual, "--listen", "a run in virtual time uses no router", alone),
        (listen and bool(connect), "--listen", "with --connect the run has no router of its own", "one of the two"),
        (
            bool(guests) and not connect and not listen,
            guests,
            "other processes cannot find the run's own router",
            "--listen or --connect as well",
        ),
        (
            wait_s is not None and not (guests or connect or listen),
            "--wait",
            "all processes start here",
            "--external, --field, or --listen as well",
        ),
        (wait_s is not None and not wait_s > 0, "--wait", f"is {wait_s}", "a number of seconds greater than 0"),
    )
    wrong = [ScenarioError(what, key=key, expected=expected) for broken, key, what, expected in rules if broken]
    if wrong:
        raise combined(wrong)


def check_viewer_at(at: str) -> None:
    """Raise ``ScenarioError`` unless a viewer can be there."""
    host, _, port = at.rpartition(":")
    if not (host and port.isascii() and port.isdigit() and 0 < int(port) < 1 << 16):
        raise ScenarioError(f"is {at!r}", key="--live-at", expected="HOST:PORT, like viewer:9091")


def check_elsewhere(
    plan: Plan, guests: Collection[str], *, reachable: bool = False, certified: bool = True, virtual: bool = False
) -> None:
    """Raise ``ScenarioError`` for what a scenario has start elsewhere, or befall there, that does not in this run.

    ``guests`` are the ids of those that start elsewhere; they find a router if it is ``reachable``, which lets them in
    if they are ``certified``.
    """
    wrong = list(_missing_faults(plan, guests))
    if plan.external and not reachable:
        some, count = plan.external[0], len(plan.external)
        who = some if count == 1 else f"{some} and {count - 1} more"
        what = f"others are to start {who}, and there are no processes in virtual time"
        expected = "a run over processes, with --listen or --connect"
        if not virtual:
            what = f"{who} cannot find the run's own router"
            expected = "--listen ENDPOINT, or --connect ENDPOINT of a router that runs"
        wrong.append(ScenarioError(what, key="run.external", expected=expected))
    elif plan.external and not certified:
        what = f"{plan.external[0]} starts elsewhere, and the certificates of this run are with its launcher alone"
        wrong.append(ScenarioError(what, key="run.external", expected="--certificates DIR as well"))
    if both := sorted(set(plan.external) & plan.bridges.keys()):
        what = f"others are to start {both[0]}, and a real device is to be in its place"
        wrong.append(ScenarioError(what, key="run.external", expected="one of the two"))
    if wrong:
        raise combined(wrong)


def _missing_faults(plan: Plan, guests: Collection[str]) -> Iterator[ScenarioError]:
    """An error for each planned fault of containers that befalls a process which is in none."""
    spared = {one.fault: one for one in plan.aways if one.id not in guests}
    for number, one in sorted(spared.items()):
        what = f"{one.kind} befalls a container, and {one.id} is in none in this run"
        expected = f"a run in containers (make field, docs/containers.md), or kind = {INSIDE[one.kind]!r}"
        yield ScenarioError(what, key=f"faults[{number}].kind", expected=expected)


def check_viewer() -> None:
    """Raise ``RunFailed`` if there is no viewer for a live view."""
    from launcher.timeline.program import program

    program()
