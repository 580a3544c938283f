"""Real devices in the place of processes: each at the other end of a serial line that the plan has."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fcntl import LOCK_EX, LOCK_NB, flock
from functools import partial
from pathlib import Path
from typing import Any, Final

from launcher.outside import CAMERA
from launcher.records import TRACKS, Plan
from trackfield.drivers.ports import HOLD_NS, PTY, Port
from trackfield.drivers.spec import ProcessSpec
from trackfield.errors import ScenarioError, together
from trackfield.plugins import place_of
from trackfield.protocols.bridge import PORT, Bridge
from trackfield.scenario.nearest import suggestion
from trackfield.wire.keys import Medium
from trackfield.wire.outside import Visca
from trackfield.wire.registry import OWN_KINDS, kind_of, kind_of_class
from trackfield.words import quoted

OPTION: Final = "--bridge"
SERIAL: Final = "--serial"
"""The same for the camera of a field: ``--serial DEVICE`` is ``--bridge camera=DEVICE``."""
LINE: Final[Medium] = "serial"
NEW: Final = "pty"
"""In the place of a device: a pseudo-terminal that the run makes."""
SUFFIX: Final = ".tty"
"""Of the link to its other end in the run folder."""
BARE_HOLD_NS: Final = 20_000_000
"""By how much bytes reach a camera later than they are written: it has to answer within 100 ms of its command."""
_VISCA: Final = kind_of_class(Visca).name
"""The only packets without frames of which it is known where they end."""


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


def with_camera(given: Sequence[str], serial: Sequence[str]) -> dict[str, str]:
    """The devices of ``--bridge`` and ``--serial`` by the id. Raises ``ScenarioError``."""
    devices = parse(given)
    if not serial:
        return devices
    device = serial[0]
    wrong = partial(ScenarioError, key=SERIAL)
    if len(serial) > 1:
        raise wrong("is there twice", expected="one device: a field has one camera")
    if not (device and device.isprintable()):
        raise wrong(f"is {quoted(device)}", expected=f"a serial device, like /dev/ttyUSB0, or {NEW}")
    if CAMERA in devices:
        raise wrong(f"{CAMERA} has a device by {OPTION}", expected="one of both")
    if device != NEW and device in devices.values():
        raise wrong(f"{device} is there twice", expected="a device of its own for each process")
    return {**devices, CAMERA: device}


def check_camera(plan: Plan, serial: Sequence[str]) -> None:
    """Raise ``ScenarioError`` if a device is to be the camera of a field that has none."""
    if serial and not any(one.id == CAMERA and LINE in one.media for one in plan.processes):
        what = f"{plan.info.scenario} has no camera"
        raise ScenarioError(what, key=SERIAL, expected='a scenario with one, by camera.kind = "evi-d30"')


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
        at = f"{PTY}{link_of(folder.absolute(), process.id)}"
        return replace(process, ports={PORT: replace(process.ports[PORT], device=at)})

    ends = {id for id, device in plan.bridges.items() if device == NEW}
    return replace(plan, processes=tuple(linked(one) if one.id in ends else one for one in plan.processes))


def with_terminals(plan: Plan, folder: Path) -> Plan:
    """The plan with the other ends of its terminals in this run folder; without, if time does not go as for people."""
    if plan.run.speed != 1:
        return plan

    def linked(process: ProcessSpec) -> ProcessSpec:
        device = f"{PTY}{link_of(folder.absolute(), process.id)}"
        ports = {name: replace(one, device=device) if one.terminal else one for name, one in process.ports.items()}
        return replace(process, ports=ports)

    return replace(plan, processes=tuple(map(linked, plan.processes)))


def link_of(folder: Path, id: str) -> Path:
    """What leads to the pseudo-terminal in the place of this process, or to its own terminal."""
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
    bare = {kind.name for kind, _ in ways if kind.bare}
    if bare and {kind.name for kind, _ in ways} != {_VISCA}:
        raise _error(f"by the line of {id} go packets without frames, {', '.join(sorted(bare))}", f"{_VISCA} alone")
    peers = sorted({other for _, pair in ways for other in pair if other != id})
    if len(peers) != 1:
        what = f"the line of {id} leads to {', '.join(peers)}" if peers else f"nothing goes by the line of {id}"
        raise _error(what, "a line to one other process: a device cannot say to whom it sends")
    return id, {
        "peer": peers[0],
        "kinds": sorted({kind.name for kind, (_, to) in ways if to == id}),
        "modules": sorted({kind.cls.__module__ for kind, _ in ways if kind.number >= OWN_KINDS}),
        "silent": [medium for medium in media[id] if medium != LINE],
        **({"bare": True} if bare else {}),
    }


def _in_place(process: ProcessSpec, arguments: dict[str, Any], device: str, baud: int) -> ProcessSpec:
    """A life of the process as a bridge: without sensor, clock and battery, which a device has of its own."""
    hold_ns = BARE_HOLD_NS if arguments.get("bare") else HOLD_NS
    at = "" if device == NEW else str(Path(device).absolute())
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
        ports={PORT: Port(device=at, hold_ns=hold_ns, baud=baud)},
    )


def _missed(plan: Plan, id: str) -> Iterator[str]:
    """What the run lacks as a device, of which it sees the line alone, has the place of this process."""
    media = next(process.media for process in plan.processes if process.id == id)
    if others := [medium for medium in media if medium != LINE]:
        yield f"a real device is in the place of {id}: nothing is sent or heard there by {', '.join(others)}"
    if any(place.id == id for place in plan.info.tagged(TRACKS)):
        yield f"a real device is in the place of {id}: the tracks that {id} publishes are missing"
    if id == CAMERA:
        yield f"a real device is in the place of {id}: where it looks is not recorded"


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
