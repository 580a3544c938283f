"""Scenario files: what stands in a field, what moves through it, and how the two are set up for a run.

The launcher's side only: a process of the field is told what it needs and never reads a scenario.
"""

from __future__ import annotations

from trackfield.scenario.packaged import names, summary
from trackfield.scenario.plan import Plan, plan
from trackfield.scenario.scenario import Scenario, schema

__all__ = ["Plan", "Scenario", "names", "plan", "schema", "summary"]
