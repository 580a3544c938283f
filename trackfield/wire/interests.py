"""The messages of directed diffusion: interests that spread, and data that answers them; docs/wire.md prints them.

Intanagonwiwat, Govindan, Estrin (2000): whoever wants data, the *sink*, spreads an *interest* through the field; the
neighbour that it came from is the *gradient* along which data goes back. The id of an interest is its sink and number.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

from trackfield.wire.registry import Blob, Scaled, kind

MOST_HOPS: Final = 255
_ID: Final = Blob(32, "id, ASCII")
_NUMBER: Final = Scaled(0, 65535, unit="number of the interest")
_PLACE: Final = Scaled(-1_000_000, 1_000_000, 0.1, "m")


@kind(62, "interest")
@dataclass(frozen=True, slots=True)
class Interest:
    """``sink`` wants data of the class ``task`` from within ``radius_m`` of (``x_m``, ``y_m``), for ``lasts_s``.

    A source sends at most one message in ``interval_s`` (0: any number). ``refresh`` counts how often the sink spread
    this interest; it has made ``hops`` hops before this one, and makes no more than ``most_hops``.
    """

    sink: Annotated[bytes, _ID]
    number: Annotated[int, _NUMBER]
    refresh: Annotated[int, Scaled(0, 65535, unit="number of the refresh")]
    task: Annotated[int, Scaled(0, 255, unit="class of data")]
    x_m: Annotated[float, _PLACE]
    y_m: Annotated[float, _PLACE]
    radius_m: Annotated[float, Scaled(0, 1_000_000, 0.1, "m")]
    interval_s: Annotated[float, Scaled(0, 655.35, 0.01, "s")]
    lasts_s: Annotated[float, Scaled(0, 6553.5, 0.1, "s")]
    hops: Annotated[int, Scaled(0, MOST_HOPS, unit="hops")]
    most_hops: Annotated[int, Scaled(0, MOST_HOPS, unit="hops")]


@kind(63, "data")
@dataclass(frozen=True, slots=True)
class Data:
    """A message of ``origin`` on its way to the sink of an interest, the ``serial``-th that it sent.

    If it is ``spread`` so many hops more, it goes to all neighbours, and finds a way; 0: along a gradient, to one.
    ``message`` is the payload; empty: the origin only says where it is, so that a way to it is found.
    """

    sink: Annotated[bytes, _ID]
    number: Annotated[int, _NUMBER]
    origin: Annotated[bytes, _ID]
    serial: Annotated[int, Scaled(0, 65535, unit="number of the message")]
    hops: Annotated[int, Scaled(0, MOST_HOPS, unit="hops")]
    spread: Annotated[int, Scaled(0, MOST_HOPS, unit="hops")]
    message: Annotated[bytes, Blob(1024, "payload")]


@kind(64, "reinforce")
@dataclass(frozen=True, slots=True)
class Reinforce:
    """The neighbour that this is for shall send data of ``origin`` to the sender: what it sent came first."""

    sink: Annotated[bytes, _ID]
    number: Annotated[int, _NUMBER]
    origin: Annotated[bytes, _ID]


@kind(65, "data-ack")
@dataclass(frozen=True, slots=True)
class DataAck:
    """A process has the ``serial``-th message of ``origin``: its neighbour need not send it again."""

    origin: Annotated[bytes, _ID]
    serial: Annotated[int, Scaled(0, 65535, unit="number of the message")]


@kind(67, "arrived")
@dataclass(frozen=True, slots=True)
class Arrived:
    """A message of ``origin`` that came over several hops, as one role of a process hands it to another.

    It never leaves the process. ``message`` is the payload.
    """

    origin: Annotated[bytes, _ID]
    message: Annotated[bytes, Blob(1024, "payload")]
