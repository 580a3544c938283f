"""What reports, a hand-over and beacons take of a step of a field of masters and slaves, by LoRa's spreading factor.

    python -m tests.cluster_budgets

prints the table of docs/scenarios.md, for the policies in ``POLICIES`` (a second). It uses the planning itself, whether
the step is long enough or not.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

from launcher.plan.architectures.clusters import Clusters
from launcher.plan.architectures.field import Field
from launcher.plan.architectures.slots import Budget, air_of, budget_of
from trackfield.role import NS
from trackfield.scenario import Scenario, survey

POLICIES: Final = ("closest", "merge_until_3")
FACTORS: Final = range(7, 13)
FIELD: Final[dict[str, Any]] = {
    "name": "budgets",
    "field": {"layout": "random", "nodes": 256, "spacing_m": 1000.0},
    "sensor": {"kind": "range", "range_m": 22627.4, "floor_sd_m": 0.1, "growth_m": 0.0044194},
    "target": {"path": "drifting", "start_m": [8000.0, 8000.0], "step_s": 2.0, "steps": 10},
    "link": {"model": "lognormal_prr", "radio": "lora868"},
    "architecture": {"kind": "clusters", "masters": 64},
    "fusion": {"trackers": ["ukf"], "prior": "paper", "prior_sd": [1.0, 1.0, 0.5, 0.5], "deadline_s": 1.2},
    "clock": {"offset_ms": 50.0, "drift_ppm": 20.0, "exchanges": 3, "resync_s": 600.0},
}
"""256 slaves and 64 masters, as in Özfidan et al. (2018), with clocks that are set every ten minutes."""


def budget(sf: int, policy: str) -> Budget:
    """What a step is taken up by with this spreading factor and policy."""
    site = survey(Scenario.load(FIELD, {"link.sf": sf, "architecture.policy": policy}))
    field = Field(site)
    clusters = Clusters(masters=64, policy=policy)
    return budget_of(air_of(site), clusters.clustered(field.site, 64), site.step_ns)


def rows() -> Iterator[str]:
    """The table, as Markdown."""
    yield "| policy | SF | a slot | all reports | a hand-over and requests | beacons | the shortest step |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    for policy in POLICIES:
        for sf in FACTORS:
            one = budget(sf, policy)
            times = (one.slot_ns, one.reports_ns, one.acts_ns, one.beacon_ns, one.least_ns)
            yield f"| `{policy}` | {sf} | {' | '.join(f'{ns / NS:.2f} s' for ns in times)} |"


if __name__ == "__main__":
    print("\n".join(rows()))
