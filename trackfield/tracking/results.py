"""What a head says of the target, as beliefs."""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

import numpy as np

from trackfield.filters.types import Gaussian
from trackfield.tracking.stored import pack
from trackfield.wire.peers import HeadEstimate, Result

LEAST_SD: Final = 0.01
"""Standard deviations are sent in steps of 0.1 m and 0.01 m/s: none is taken for less than this."""


def beliefs_of(message: Result | HeadEstimate, trackers: Collection[str]) -> bytes:
    """The beliefs (``trackfield/tracking/stored.py``) of these trackers after the step of the message.

    A result is of x, y, vx, vy alone, and the same for all of them.
    """
    if isinstance(message, HeadEstimate):
        return message.beliefs
    mean = np.array([message.x_m, message.y_m, message.vx_m_s, message.vy_m_s])
    sds = np.maximum([message.sd_m] * 2 + [message.speed_sd_m_s] * 2, LEAST_SD)
    return pack(message.step, None, dict.fromkeys(trackers, Gaussian(mean, np.diag(np.square(sds)))))
