"""Radio links and clocks: losses and delays of frames, and local time. Scalar, without numpy."""

from __future__ import annotations

from trackfield.link.clock import Clock
from trackfield.link.fate import MIN_DELAY_NS, Fate, Link
from trackfield.link.models import MODELS, make_link
from trackfield.link.partitioned import Partitioned
from trackfield.link.places import Places, position

__all__ = ["MIN_DELAY_NS", "MODELS", "Clock", "Fate", "Link", "Partitioned", "Places", "make_link", "position"]
