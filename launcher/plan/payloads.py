"""What sensors that hear targets pass report, and their heads: the longest payloads of messages that carry it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from head.hearing.memory import Pass
from head.hearing.told import fix_report
from trackfield.filters.measurement import STATE
from trackfield.filters.types import Gaussian
from trackfield.role import NS
from trackfield.sensing.kinds import make_sensor
from trackfield.tracking.bank import Bank
from trackfield.wire.codec import encode
from trackfield.wire.passes import MOST_RAW

_ID: Final = "n000"


def payloads(tracking: Mapping[str, Any]) -> tuple[bytes, bytes]:
    """A report, and a fix of all that trackers know with as many raw reports as it holds.

    ``tracking`` are the arguments of a ``Bank``.
    """
    kinds = [make_sensor(**given) for given in tracking["sensing"].values()]
    longest = max((kind.longest() for kind in kinds), key=lambda message: len(encode(message)))
    bank = Bank(**tracking)
    known = dict.fromkeys(bank.trackers, Gaussian(np.zeros(STATE), np.eye(STATE)))
    beliefs = bank.beliefs(bank.resume(known, 0, 0).tracks)
    passes = [(number, Pass(_ID, longest, 0)) for number in range(MOST_RAW)]
    return encode(longest), encode(fix_report(1, 1000, NS, beliefs, (), passes))
