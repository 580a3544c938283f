"""Scenario files: what stands in a field, what moves through it, and how the two are set up for a run.

Only the launcher reads scenarios: the processes of a field are given what they need.
"""

from __future__ import annotations

from trackfield.scenario.packaged import names, summary
from trackfield.scenario.scenario import Scenario, schema
from trackfield.scenario.survey import Site, survey

__all__ = ["Scenario", "Site", "names", "schema", "summary", "survey"]
