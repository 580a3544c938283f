"""Real devices in the place of processes: each at the other end of a serial line that the plan has."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fcntl import LOCK_EX, LOCK_NB, flock
from functools import partial
from pathlib import Path
from typing import Any, Final

from launcher.records import TRACKS, Plan
from trackfield.drivers.ports import PTY, Port
from trackfield.drivers.spec import ProcessSpec
from trackfield.errors import ScenarioError, together
from trackfield.plugins import place_of
from trackfield.protocols.bridge import PORT, Bridge
from trackfield.scenario.nearest import suggestion
from trackfield.wire.keys import Medium
from trackfield.wire.registry import OWN_KINDS, kind_of
from trackfield.words import quoted

OPTION: Final = "--bridge"
LINE: Final[Medium] = "serial"
NEW: Final = "pty"
"""In the place of a device: a pseudo-terminal that the run makes."""
SUFFIX: Final = ".tty"
"""Of the link to its other end in the run folder."""


def parse(given: Sequence[str]) -> dict[str, str]:
    """The devices of ``ID=DEVICE`` by the id. Raises ``ScenarioError``."""
    devices: dict[str, str] = {}
    for text in given:
        id, _, device = text.partition("=")
        if not (id and device and device.isprintable()):
            raise _error(f"is {quoted(text)}", "ID=DEVICE, like base=/dev/ttyUSB0, or ID=pty")
        if id in devices:
            raise _error(f"{id} is there twice", "one device for each process")
        if device != NEW and device in devices.values():
            raise _error(f"{device} is there twice", "a device of its own for each process")
        devices[id] = device
    return devices


def bridged(plan: Plan, devices: Mapping[str, str]) -> Plan:
    """The plan with these devices, or what ``NEW`` says, in the place of the processes of these ids.

    Raises ``ScenarioError`` for one that is no process of the plan, or has not one process at its serial line.
    """
    if not devices:
        return plan
    bridges = dict(together(partial(_bridge, plan, id) for id in devices))
    processes = tuple(
        _in_place(one, bridges[one.id], devices[one.id], plan.run.media[LINE]["baud"]) if one.id in devices else one
        for one in plan.processes
    )
    warnings = (*plan.warnings, *(text for id in devices for text in _missed(plan, id)))
    return replace(plan, processes=processes, bridges=dict(devices), warnings=warnings)


def looked_for(plan: Plan) -> Plan:
    """The plan with a warning for each device that is not there yet. Raises ``ScenarioError`` for what is none."""
    found = together(partial(_look, id, device) for id, device in plan.bridges.items() if device != NEW)
    return replace(plan, warnings=(*plan.warnings, *filter(None, found)))


def in_folder(plan: Plan, folder: Path) -> Plan:
    """The plan with the other ends of its pseudo-terminals in this run folder."""

    def linked(process: ProcessSpec) -> ProcessSpec:
        port = Port(device=f"{PTY}{link_of(folder.absolute(), process.id)}", baud=process.ports[PORT].baud)
        return replace(process, ports={PORT: port})

    ends = {id for id, device in plan.bridges.items() if device == NEW}
    return replace(plan, processes=tuple(linked(one) if one.id in ends else one for one in plan.processes))


def link_of(folder: Path, id: str) -> Path:
    """What leads to the pseudo-terminal in the place of this process."""
    return folder / f"{id}{SUFFIX}"


def _bridge(plan: Plan, id: str) -> tuple[str, dict[str, Any]]:
    """The arguments of the ``Bridge`` in the place of this process."""
    media = {process.id: process.media for process in plan.processes}
    wired = sorted(other for other in media if LINE in media[other])
    expected = f"one of {', '.join(wired)}" if wired else f"a process with {LINE!r} among its media, which none has"
    if id not in media:
        raise _error(f"there is no process {quoted(id)}{suggestion(id, media)}", expected)
    if id not in wired:
        raise _error(f"{id} has no serial line, only {', '.join(media[id])}", expected)
    ways = [
        (kind_of(flow.message), pair)
        for flow in plan.flows
        for pair in flow.pairs
        if flow.medium == LINE and id in pair
    ]
    peers = sorted({other for _, pair in ways for other in pair if other != id})
    if len(peers) != 1:
        what = f"the line of {id} leads to {', '.join(peers)}" if peers else f"nothing goes by the line of {id}"
        raise _error(what, "a line to one other process: a device cannot say to whom it sends")
    return id, {
        "peer": peers[0],
        "kinds": sorted({kind.name for kind, (_, to) in ways if to == id}),
        "modules": sorted({kind.cls.__module__ for kind, _ in ways if kind.number >= OWN_KINDS}),
        "silent": [medium for medium in media[id] if medium != LINE],
    }


def _in_place(process: ProcessSpec, arguments: dict[str, Any], device: str, baud: int) -> ProcessSpec:
    """A life of the process as a bridge: without sensor, clock and battery, which a device has of its own."""
    return replace(
        process,
        factory=place_of(Bridge),
        config=arguments,
        sound={},
        sink=False,
        clock={},
        power={},
        devices={},
        jumps=(),
        faults=(),
        ports={PORT: Port(device="" if device == NEW else str(Path(device).absolute()), baud=baud)},
    )


def _missed(plan: Plan, id: str) -> Iterator[str]:
    """What the run lacks as a device, of which it sees the line alone, has the place of this process."""
    media = next(process.media for process in plan.processes if process.id == id)
    if others := [medium for medium in media if medium != LINE]:
        yield f"a real device is in the place of {id}: nothing is sent or heard there by {', '.join(others)}"
    if any(place.id == id for place in plan.info.tagged(TRACKS)):
        yield f"a real device is in the place of {id}: the tracks that {id} publishes are missing"


def _look(id: str, device: str) -> str:
    """A warning if the device is not there. Raises ``ScenarioError`` if it cannot be used, or is no terminal."""
    try:
        file = os.open(device, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except FileNotFoundError:
        return f"{device} is not there yet, and waited for: what is sent to {id} meanwhile is lost"
    except OSError as error:
        raise _error(f"{device} cannot be opened ({error.strerror})", "a serial device to read and write") from None
    try:
        if not os.isatty(file):
            raise _error(f"{device} is not a terminal", "a serial device, or pty")
        flock(file, LOCK_EX | LOCK_NB)
    except BlockingIOError:
        raise _error(f"{device} is in use by another process", "a device that is free") from None
    finally:
        os.close(file)
    return ""


def _error(what: str, expected: str) -> ScenarioError:
    return ScenarioError(what, key=OPTION, expected=expected)
