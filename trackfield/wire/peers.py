"""The messages of nodes of which any may become the head: elections, polls, results; docs/wire.md prints them.

A *term* is a time for which one node leads, as in ``clusters.py``: a number, which grows with each hand-over, take-over
and election, and the head's id. Each of these messages has the number. Hand-overs and their acknowledgements, doubts
and what a base is told are the messages of ``clusters.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

from trackfield.wire.clusters import BELIEFS_BYTES
from trackfield.wire.registry import Blob, Scaled, kind

MOST_KEY: Final = 65535
"""The weakest key of an election."""
MOST_SENSORS: Final = 50
"""A head asks so many sensors at most."""
_NUMBER: Final = Scaled(0, 2**31 - 1, unit="number of the term")
_STEP: Final = Scaled(0, 65535, unit="filter step")
_KEY: Final = Scaled(0, MOST_KEY, unit="key, 0 the strongest")
_EXPIRY: Final = Scaled(0, 65535, unit="filter step")
_PLACE: Final = Scaled(-1_000_000, 1_000_000, 0.1, "m")
_SPEED: Final = Scaled(-1000, 1000, 0.01, "m/s")
_ID: Final = Blob(32, "id, ASCII")


@kind(50, "claim")
@dataclass(frozen=True, slots=True)
class Claim:
    """A node that senses a target, and hears no head, wants to lead in the term of this ``number``.

    The smaller its ``key``, the louder it hears the target. The claim is void after the step ``expires``.
    """

    number: Annotated[int, _NUMBER]
    key: Annotated[int, _KEY]
    expires: Annotated[int, _EXPIRY]


@kind(51, "join-claim")
@dataclass(frozen=True, slots=True)
class JoinClaim:
    """A node supports the best claim that it heard, of node ``head`` with ``key``, and hands it on to all in reach.

    ``own`` is the key of the sender itself: how loud it hears the target; 65535: it does not. Once a node leads, those
    that sense the target tell it so by this message, too; that holds up to the step ``expires``.
    """

    number: Annotated[int, _NUMBER]
    key: Annotated[int, _KEY]
    head: Annotated[bytes, _ID]
    own: Annotated[int, _KEY]
    expires: Annotated[int, _EXPIRY]


@kind(52, "poll")
@dataclass(frozen=True, slots=True)
class Poll:
    """The head has these ``sensors`` measure at the instant of ``step``, and report to it, in this order.

    They are numbers in the field's list, two little-endian bytes each. All others that hear it know that it leads.

    """

    number: Annotated[int, _NUMBER]
    step: Annotated[int, _STEP]
    sensors: Annotated[bytes, Blob(2 * MOST_SENSORS, "numbers of sensors")]


@kind(53, "result")
@dataclass(frozen=True, slots=True)
class Result:
    """Where the head's first tracker has the target at the instant of ``step``; the sd of its position and velocity."""

    number: Annotated[int, _NUMBER]
    step: Annotated[int, _STEP]
    x_m: Annotated[float, _PLACE]
    y_m: Annotated[float, _PLACE]
    vx_m_s: Annotated[float, _SPEED]
    vy_m_s: Annotated[float, _SPEED]
    sd_m: Annotated[float, Scaled(0, 6553.5, 0.1, "m")]
    speed_sd_m_s: Annotated[float, Scaled(0, 655.35, 0.01, "m/s")]


@kind(54, "estimate")
@dataclass(frozen=True, slots=True)
class HeadEstimate:
    """What the head's trackers know after ``step``, for all in reach: with that another node may go on."""

    number: Annotated[int, _NUMBER]
    step: Annotated[int, _STEP]
    beliefs: Annotated[bytes, Blob(BELIEFS_BYTES, "beliefs")]


@kind(55, "dissolve")
@dataclass(frozen=True, slots=True)
class Dissolve:
    """The head's term is over after ``step``: it has ``lost`` the target (1), or found nobody to hand over to (0)."""

    number: Annotated[int, _NUMBER]
    step: Annotated[int, _STEP]
    lost: Annotated[int, Scaled(0, 1, unit="0 or 1")]


@kind(56, "local-estimate")
@dataclass(frozen=True, slots=True)
class LocalEstimate:
    """What a polled node concludes from the head's last estimate and its own reading of ``step``: ``beliefs``.

    A head that yields to one of a higher term tells it by this message, too, what its trackers know.
    """

    number: Annotated[int, _NUMBER]
    step: Annotated[int, _STEP]
    beliefs: Annotated[bytes, Blob(BELIEFS_BYTES, "beliefs")]
