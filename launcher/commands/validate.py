"""``validate``."""

from __future__ import annotations

import json
from collections import Counter
from typing import TYPE_CHECKING

from launcher.commands.request import Request, command
from trackfield.errors import RunFailed, ScenarioError

if TYPE_CHECKING:
    from launcher.records import Plan


@command(Request)
def validate(request: Request) -> None:
    """Check a scenario, with the options of run: list all that is wrong with it, or what to expect of the run.

    What this machine lacks for the run is a warning.
    """
    from launcher.plan.forecast.foresight import foresee
    from launcher.plan.forecast.warnings import summary
    from launcher.show import announce, assess, warn

    try:
        _, plan = request.prepared()
    except ScenarioError as error:
        if request.as_json:
            print(json.dumps({"valid": False, "errors": [str(part) for part in error.parts]}, indent=2))
        raise
    seen, lacking = foresee(plan), _lacking(request, plan)
    if request.as_json:
        found = {"valid": True, "warnings": list(plan.warnings), "summary": list(summary(plan, seen))}
        roles = Counter(place.role for place in plan.info.places)
        told = {"machine": lacking, "processes": roles, "containers": [one.plain() for one in plan.aways]}
        print(json.dumps(found | told, indent=2))
    if not request.quiet:
        announce(plan)
        assess(plan, seen)
        if lacking:
            warn([f"not on this machine: {'; '.join(lacking)}"])


def _lacking(request: Request, plan: Plan) -> list[str]:
    """What this machine lacks for the run."""
    try:
        request.check_machine(plan)
    except RunFailed as error:
        return str(error).splitlines()
    return []
