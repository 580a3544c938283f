"""``list``."""

from __future__ import annotations

import json
from typing import Annotated

import typer


def list_scenarios(
    schema: Annotated[
        bool, typer.Option("--schema", help="Print the JSON schema of scenario files, for editors.")
    ] = False,
) -> None:
    """List the packaged scenarios, the trackers and the kinds of sensors."""
    from trackfield import scenario
    from trackfield.filters.trackers import TRACKERS
    from trackfield.world.sensors import SENSORS

    if schema:
        print(json.dumps(scenario.schema(), indent=2))
        return
    for name in scenario.names():
        print(f"{name:12} {scenario.summary(name)}")
    print(f"trackers: {', '.join(TRACKERS)}")
    print(f"sensors: {', '.join(SENSORS)}")
