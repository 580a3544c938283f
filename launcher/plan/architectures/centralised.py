"""All sensor nodes report to one fusion centre, which tracks; it is the reference of their clocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from launcher.plan.architectures.architecture import Arranged
from launcher.plan.hardware import FJ_PER_MJ, clock_of, duty_of, power_of, sync_of
from launcher.plan.roles import factory
from launcher.plan.tracking import if_used, tracking_of
from launcher.records import BATTERY, SENSES, TRACKS, Flow, Place, View
from trackfield.drivers.spec import ProcessSpec, places_of
from trackfield.role import NS
from trackfield.scenario import Scenario, Site
from trackfield.scenario.sensors import Acoustic
from trackfield.sensing.kinds import make_sensor
from trackfield.wire.messages import Doa, Measurement, SyncReply, SyncRequest, Threshold

NODE: Final = "node"
CENTRE: Final = "fusion"
"""The role of the centre, whatever its id."""


class Centralised:
    """See the module; ``places`` has the centre first."""

    def __init__(self, site: Site) -> None:
        self.site, self.scenario = site, site.scenario
        self.centre = site.scenario.architecture.centre

    def places(self) -> tuple[Place, ...]:
        """See ``Architecture``."""
        mains = self.scenario.energy.centre_battery_j is None
        tags = frozenset({TRACKS} if mains else {TRACKS, BATTERY})
        centre = Place(self.centre, CENTRE, *self.site.centre, tags)
        node = frozenset({SENSES, BATTERY})
        return (centre, *(Place(id, NODE, x, y, node) for id, x, y in self.site.sensors))

    def views(self) -> tuple[View, ...]:
        """See ``Architecture``: the centre is the base, and only the centre tracks."""
        return (View("base", (self.centre,)),)

    def arrange(self, end_ns: int) -> Arranged:
        """See ``Architecture``. Messages go between nodes and centre only."""
        tracking = tracking_of(self.site, self.centre)
        nodes = tuple(self._nodes(end_ns))
        centre = self._centre(tracking, nodes)
        return Arranged((centre, *nodes), tracking, list(self._flows(tracking, end_ns)))

    def _nodes(self, end_ns: int) -> Iterator[ProcessSpec]:
        """The sensor nodes; values that are the same for all of them are shared."""
        site, scenario, role = self.site, self.scenario, factory(NODE)
        power = power_of(scenario, scenario.energy.battery_j, round(scenario.energy.sample_mj * FJ_PER_MJ))
        peers = {self.centre: site.route or site.centre}
        for index, (id, x, y) in enumerate(site.sensors):
            config: dict[str, Any] = {
                "step_ns": site.step_ns,
                **_threshold_db(scenario),
                "centre": self.centre,
                **if_used(
                    origin_ns=site.origin_ns,
                    sync=sync_of(scenario, id, self.centre),
                    adaptive=duty_of(scenario, site.origin_ns, end_ns),
                ),
            }
            sound, clock = site.sound(index), clock_of(scenario, id)
            yield ProcessSpec(id, NODE, role, config, x, y, sound, peers=peers, clock=clock, power=power)

    def _centre(self, tracking: Mapping[str, Any], nodes: tuple[ProcessSpec, ...]) -> ProcessSpec:
        fusion = self.scenario.fusion
        config: dict[str, Any] = {
            **tracking,
            "deadline_ns": round(fusion.deadline_s * NS),
            **if_used(max_age_ns=round(fusion.max_age_s * NS), threshold=_threshold(self.scenario)),
        }
        return ProcessSpec(
            self.centre,
            CENTRE,
            factory(CENTRE),
            config,
            *self.site.centre,
            sink=True,
            peers=places_of(nodes),
            power=power_of(self.scenario, self.scenario.energy.centre_battery_j),
            legs=self.site.route,
        )

    def _flows(self, tracking: Mapping[str, Any], end_ns: int) -> Iterator[Flow]:
        """The messages between them, reports first."""
        there = tuple((id, self.centre) for id, *_ in self.site.sensors)
        back = tuple((b, a) for a, b in there)
        now_us = end_ns // 1000
        yield Flow(_report(tracking), there)
        if sync_of(self.scenario, self.site.sensors[0][0], self.centre):
            yield Flow(SyncRequest(65535, now_us), there)
            yield Flow(SyncReply(65535, now_us, now_us, now_us), back)
        if _threshold(self.scenario):
            yield Flow(Threshold(65535, 70.0), back)


def _report(tracking: Mapping[str, Any]) -> Doa | Measurement:
    """A report that is as long as any; for a user's own sensor, with as many numbers as it measures."""
    if "sensor" not in tracking:
        return Doa(step=65535, bearing_deg=359.99, level_db=70.0)
    return Measurement(65535, (2**15 - 1,) * len(make_sensor(**tracking["sensor"]).resolution))


def _threshold_db(scenario: Scenario) -> Mapping[str, float]:
    """The level above which sensors report, if they measure levels."""
    return {"threshold_db": scenario.sensor.threshold_db} if isinstance(scenario.sensor, Acoustic) else {}


def _threshold(scenario: Scenario) -> Mapping[str, float] | None:
    """The bounds and the start of the threshold that the centre sets, and its reach; None: it sets none."""
    sensor = scenario.sensor
    if not isinstance(sensor, Acoustic) or not sensor.adaptive:
        return None
    low, high = sensor.thresholds_db
    awake_m, _ = sensor.reach_m()
    return {
        "low_db": low,
        "high_db": high,
        "start_db": sensor.threshold_db,
        "target_sd_m": scenario.fusion.target_sd_m,
        "reach_m": awake_m,
    }
