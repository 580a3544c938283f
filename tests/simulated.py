"""Runs in virtual time that leave no files behind."""

from __future__ import annotations

from collections.abc import Sequence

from launcher.prepare import load, planned
from launcher.records import Plan
from launcher.virtually import simulate as simulated

__all__ = ["simulated", "spcpf"]


def spcpf(seed: int = 1, settings: Sequence[str] = ()) -> Plan:
    """The plan of the packaged scenario ``spcpf`` with some settings."""
    return planned(load("spcpf", seed=seed, settings=settings))
