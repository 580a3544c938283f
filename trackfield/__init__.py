"""Trackfield emulates field deployments that track moving targets with networks of small sensors.

The names of the Python API are imported on first use, so that a node's process stays light.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from trackfield.errors import RunFailed, ScenarioError, TrackfieldError
    from trackfield.scenario import Scenario

_HOMES: Final = {
    "RunFailed": "trackfield.errors",
    "Scenario": "trackfield.scenario",
    "ScenarioError": "trackfield.errors",
    "TrackfieldError": "trackfield.errors",
}

__all__ = ["RunFailed", "Scenario", "ScenarioError", "TrackfieldError"]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'trackfield' has no attribute {name!r}")
