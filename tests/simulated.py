"""Runs in virtual time that leave no files behind."""

from __future__ import annotations

from collections.abc import Sequence

from launcher.plan.prepare import load, planned
from launcher.record.virtually import simulate as simulated
from launcher.records import Plan

__all__ = ["simulated", "spcpf"]


def spcpf(seed: int = 1, settings: Sequence[str] = ()) -> Plan:
    """The plan of the packaged scenario ``spcpf`` with some settings."""
    return planned(load("spcpf", seed=seed, settings=settings))
