"""Trackfield emulates field deployments that track moving targets with networks of small sensors.

The names of the Python API are imported on first use, so that a node's process stays light.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from trackfield.errors import RunFailed, ScenarioError, TrackfieldError
    from trackfield.filters.trackers import register_tracker
    from trackfield.filters.types import Estimate, Gaussian, Model, Reports
    from trackfield.scenario import Scenario

_HOMES: Final = {
    "Estimate": "trackfield.filters.types",
    "Gaussian": "trackfield.filters.types",
    "Model": "trackfield.filters.types",
    "Reports": "trackfield.filters.types",
    "RunFailed": "trackfield.errors",
    "Scenario": "trackfield.scenario",
    "ScenarioError": "trackfield.errors",
    "TrackfieldError": "trackfield.errors",
    "register_tracker": "trackfield.filters.trackers",
}

__all__ = [
    "Estimate",
    "Gaussian",
    "Model",
    "Reports",
    "RunFailed",
    "Scenario",
    "ScenarioError",
    "TrackfieldError",
    "register_tracker",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'trackfield' has no attribute {name!r}")
