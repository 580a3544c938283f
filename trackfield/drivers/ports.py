"""Device ports of a process, and what comes in there.

What is known beforehand, such as the record of a device, is input under both drivers, at its instants. A real device
(``devices.py``) takes part in runs as processes at speed 1; what it sends is stamped as it arrives, so such runs are
not repeatable.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from operator import itemgetter
from typing import Any, Final, Self

from trackfield.drivers.engine.frames import PortInput

HOLD_NS: Final = 100_000_000
"""By how much bytes reach a device later than they are written, unless its port says otherwise."""
PTY: Final = "pty:"
"""What the path of a link to a pseudo-terminal begins with, in the place of a device's."""
BAUD: Final = 115_200


@dataclass(frozen=True, slots=True)
class Port:
    """A port: the ``reads`` are bytes that come in, and when (true time, ns).

    ``device`` is the path of a real one, such as a serial line, of ``baud`` bits a second; ``pty:LINK`` makes a
    pseudo-terminal, and LINK names its other end while the process is there. What is written to it leaves ``hold_ns``
    (wall time) after its instant: until then it can still be taken back.

    One that is a ``terminal`` is where people type: a run as processes at speed 1 makes a pseudo-terminal for it, whose
    other end is in the run folder.
    """

    reads: tuple[tuple[int, bytes], ...] = ()
    device: str = ""
    hold_ns: int = HOLD_NS
    baud: int = BAUD
    terminal: bool = False

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> Self:
        """From a mapping of its fields."""
        return cls(**{**plain, "reads": tuple((at_ns, data) for at_ns, data in plain["reads"])})


def inputs(ports: Mapping[str, Port]) -> Iterator[PortInput]:
    """What comes in at these ports, by their names, in order: at one instant by name, then as given."""
    read = ((at_ns, name, data) for name, port in ports.items() for at_ns, data in port.reads)
    reads = sorted(read, key=itemgetter(0, 1))
    return (PortInput(at_ns, number, name, data) for number, (at_ns, name, data) in enumerate(reads))
