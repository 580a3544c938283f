"""The messages of sensors that hear targets pass: reports of closest points of approach, and fixes; docs/wire.md.

*CPA* is the closest point of approach of a target to a sensor (Yang et al., section 3.1).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

from trackfield.wire.registry import Blob, Scaled, kind

EVENTS: Final = 256
"""The passes that a sensor reports are numbered modulo this."""
MOST_EARLY_S: Final = 6.5535
PASSES: Final = 1
"""The class of data of reports of passes, in interests."""
FIXES: Final = 2
"""That of fixes."""
MOST_RAW: Final = 8
"""A fix has so many raw reports at most."""
_STEP: Final = Scaled(0, 65535, unit="filter step")
_EARLY: Final = Scaled(0, MOST_EARLY_S, 0.0001, "s")
_EVENT: Final = Scaled(0, EVENTS - 1, unit="number of the pass, cyclic")
_STRENGTH: Final = Scaled(-100, 200, 0.01, "dB")
_WIDTH: Final = Scaled(0, 6.375, 0.025, "s")


@kind(60, "cpa-report")
@dataclass(frozen=True, slots=True)
class CpaReport:
    """A sensor heard a target pass: it was loudest ``early_s`` before the instant of ``step``, by the sensor's time.

    ``event`` counts the passes that this sensor reported. ``strength_db`` is the amplitude then, in dB, and the pulse
    is as wide as ``width_s``, the distance divided by the speed; 0: not known.
    """

    step: Annotated[int, _STEP]
    early_s: Annotated[float, _EARLY]
    event: Annotated[int, _EVENT]
    strength_db: Annotated[float, _STRENGTH]
    width_s: Annotated[float, _WIDTH]


@kind(61, "cpa-report-sds")
@dataclass(frozen=True, slots=True)
class CpaReportSds:
    """The same, with the standard deviations of time and strength as the sensor judges them."""

    step: Annotated[int, _STEP]
    early_s: Annotated[float, _EARLY]
    event: Annotated[int, _EVENT]
    strength_db: Annotated[float, _STRENGTH]
    width_s: Annotated[float, _WIDTH]
    time_sd_s: Annotated[float, _EARLY]
    strength_sd_db: Annotated[float, Scaled(0, 100, 0.01, "dB")]


@kind(66, "fix")
@dataclass(frozen=True, slots=True)
class FixReport:
    """What the reports of an event say: ``belief`` (as in ``hand-over``) at the instant of ``step``; empty: no fix.

    It is that of those trackers that have a fix. ``number`` counts the events of the head that sends it. ``reason``
    says why the first tracker that has no fix has none (docs/wire.md); 0: none says so. ``raw`` are the reports that it
    is made of, eight bytes each, little-endian: number of the sensor in the field's list, time before the step (0.1
    ms), strength (0.01 dB, signed), width (25 ms).
    """

    number: Annotated[int, Scaled(0, 65535, unit="number of the event")]
    step: Annotated[int, _STEP]
    reason: Annotated[int, Scaled(0, 255, unit="reason")]
    belief: Annotated[bytes, Blob(1024, "belief")]
    raw: Annotated[bytes, Blob(8 * MOST_RAW, "raw reports")]
