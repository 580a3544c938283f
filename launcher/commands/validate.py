"""``validate``."""

from __future__ import annotations

import json

from launcher.commands.request import Request, command
from trackfield.errors import ScenarioError


@command(Request)
def validate(request: Request) -> None:
    """Check a scenario, with the options of run: list all that is wrong with it, or what to expect of the run."""
    from launcher.plan.foresight import foresee
    from launcher.plan.warnings import summary
    from launcher.show import announce, assess

    try:
        _, plan = request.prepared()
    except ScenarioError as error:
        if request.as_json:
            print(json.dumps({"valid": False, "errors": [str(part) for part in error.parts]}, indent=2))
        raise
    seen = foresee(plan)
    if request.as_json:
        found = {"valid": True, "warnings": list(plan.warnings), "summary": list(summary(plan, seen))}
        print(json.dumps(found, indent=2))
    if not request.quiet:
        announce(plan)
        assess(plan, seen)
