"""``validate``."""

from __future__ import annotations

from launcher.commands.arguments import Name, Sensors, Set


def validate(scenario: Name, overrides: Set = None, sensors: Sensors = None) -> None:
    """Check a scenario and say what it comes to."""
    from launcher.plan.prepare import load, planned
    from launcher.show import announce, foresee

    plan = planned(load(scenario, settings=overrides or (), sensors=sensors))
    announce(plan)
    foresee(plan)
