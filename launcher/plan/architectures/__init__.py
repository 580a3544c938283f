"""Architectures: which processes there are, who tracks, and how reports reach them; Trackfield's own one file each."""

from __future__ import annotations

from launcher.plan.architectures.arranged import Arranged, Hosted, Process
from launcher.plan.architectures.built import (
    ARCHITECTURES,
    Architecture,
    Built,
    built,
    make_architecture,
    register_architecture,
    surveyed,
)
from launcher.plan.architectures.field import Field

__all__ = [
    "ARCHITECTURES",
    "Architecture",
    "Arranged",
    "Built",
    "Field",
    "Hosted",
    "Process",
    "built",
    "make_architecture",
    "register_architecture",
    "surveyed",
]
