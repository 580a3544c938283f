"""The ports that an architecture gives its processes, checked before anything is made of them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from numbers import Integral
from operator import itemgetter
from typing import Any, Final

from launcher.plan.architectures.arranged import Process
from launcher.records import Plan
from trackfield.drivers.ports import Port
from trackfield.errors import ScenarioError
from trackfield.scenario.section import ID, ID_WORDS
from trackfield.words import quoted

MOST_BYTES: Final = 16 * 2**20
"""What may come in at the ports of a process, as far as it is known beforehand: a process is told all of it."""
MOST_NS: Final = 2**63 - 1
SLOWEST: Final = 50
FASTEST: Final = 10_000_000
"""Bits per second of a line, as in ``[serial]``."""

Fail = Callable[[str, str, str], ScenarioError]
"""Makes the error of where it is, what is wrong, and what is expected."""


def checked_ports(process: Process, fail: Fail) -> dict[str, Port]:
    """The ports of a process by their names, with what comes in there in order. Raises what ``fail`` makes."""
    where, ports = f"{process.id}.ports", process.ports
    if not (isinstance(ports, Mapping) and all(isinstance(port, Port) for port in ports.values())):
        raise fail(where, f"is {quoted(ports)}", "a dict of a tf.Port for each port by its name")
    for name in ports:
        _check_name(where, name, process, fail)
    checked = {name: _port(f"{where}.{name}", port, fail) for name, port in ports.items()}
    if sum(port.terminal for port in checked.values()) > 1:
        raise fail(where, "has several terminals", "one of a process at most: it is named after the process")
    if (size := sum(len(data) for port in checked.values() for _, data in port.reads)) > MOST_BYTES:
        raise fail(where, f"{size} bytes come in there", f"at most {MOST_BYTES} bytes in all")
    return checked


def check_devices(plan: Plan) -> None:
    """Raise ``ScenarioError`` if a process has a device and time does not go as fast for it as for the device."""
    if plan.run.speed == 1:
        return
    for process in plan.processes:
        for name, port in process.ports.items():
            if port.device:
                what = f"is {plan.run.speed:g}, and port {name} of {process.id} has the device {quoted(port.device)}"
                raise ScenarioError(what, key="--speed", expected="1, or a port without a device")


def _check_name(where: str, name: Any, process: Process, fail: Fail) -> None:
    of, _, own = name.rpartition("/") if isinstance(name, str) else ("", "", "")
    if process.roles and of not in process.roles:
        roles = ", ".join(process.roles)
        raise fail(where, f"the name of a port is {quoted(name)}", f"ROLE/PORT, with one of its roles {roles}")
    if not re.fullmatch(ID, own) or (of and not process.roles):
        raise fail(where, f"the name of a port is {quoted(name)}", ID_WORDS)


def _port(where: str, port: Port, fail: Fail) -> Port:
    device, hold_ns, reads = port.device, port.hold_ns, port.reads
    if not isinstance(device, str) or not device.isprintable():
        raise fail(f"{where}.device", f"is {quoted(device)}", "the path of a device, or '' for none")
    if not _time(hold_ns):
        raise fail(f"{where}.hold_ns", f"is {quoted(hold_ns)}", "whole nanoseconds of wall time, from 0")
    if not (_time(port.baud) and SLOWEST <= port.baud <= FASTEST):
        raise fail(
            f"{where}.baud", f"is {quoted(port.baud)}", f"bits per second, a whole number from {SLOWEST} to {FASTEST}"
        )
    if not isinstance(port.terminal, bool) or (port.terminal and device):
        raise fail(f"{where}.terminal", f"is {quoted(port.terminal)}", "True or False, and no device beside it")
    several = isinstance(reads, Iterable) and not isinstance(reads, str | bytes | Mapping)
    listed: list[Any] = list(reads) if several else [reads]
    for read in listed:
        if not (isinstance(read, tuple | list) and len(read) == 2 and _time(read[0]) and isinstance(read[1], bytes)):
            expected = "(t, bytes), with whole nanoseconds t from 0 since the start of the run"
            raise fail(f"{where}.reads", f"has {quoted(read)}", expected)
    in_order = sorted(((int(at_ns), data) for at_ns, data in listed), key=itemgetter(0))
    return replace(port, reads=tuple(in_order), hold_ns=int(hold_ns), baud=int(port.baud))


def _time(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool) and 0 <= int(value) <= MOST_NS
