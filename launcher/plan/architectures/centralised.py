"""All sensor nodes report to one fusion centre, which tracks; it is the reference of their clocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from launcher.plan.architectures.architecture import Arranged
from launcher.plan.hardware import FJ_PER_MJ, adaptive, clock_of, duty_of, power_of, sync_of
from launcher.plan.roles import factory
from launcher.plan.tracking import if_used, tracking_of
from launcher.records import BATTERY, SENSES, TRACKS, Flow, Place, View
from trackfield.drivers.spec import ProcessSpec, places_of
from trackfield.role import NS
from trackfield.scenario import Site
from trackfield.wire.messages import SyncReply, SyncRequest, Threshold

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
        return Arranged((centre, *nodes), tracking, list(self._flows(end_ns)))

    def _nodes(self, end_ns: int) -> Iterator[ProcessSpec]:
        """The sensor nodes; values that are the same for all of them are shared."""
        site, scenario, role = self.site, self.scenario, factory(NODE)
        power = power_of(scenario, scenario.energy.battery_j, round(scenario.energy.sample_mj * FJ_PER_MJ))
        peers = {self.centre: site.route or site.centre}
        for index, (id, x, y) in enumerate(site.sensors):
            config: dict[str, Any] = {
                "step_ns": site.step_ns,
                **_threshold_db(site, index),
                "centre": self.centre,
                **if_used(
                    origin_ns=site.origin_ns,
                    sync=sync_of(scenario, id),
                    adaptive=duty_of(scenario, site.origin_ns, end_ns),
                ),
            }
            sound, clock = site.sensor(index).to_plain(), clock_of(scenario, id)
            yield ProcessSpec(id, NODE, role, config, x, y, sound, peers=peers, clock=clock, power=power)

    def _centre(self, tracking: Mapping[str, Any], nodes: tuple[ProcessSpec, ...]) -> ProcessSpec:
        fusion = self.scenario.fusion
        config: dict[str, Any] = {
            **tracking,
            "deadline_ns": round(fusion.deadline_s * NS),
            **if_used(max_age_ns=round(fusion.max_age_s * NS), threshold=_threshold(self.site)),
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

    def _flows(self, end_ns: int) -> Iterator[Flow]:
        """The messages between them, reports first."""
        there = tuple((id, self.centre) for id, *_ in self.site.sensors)
        back = tuple((b, a) for a, b in there)
        now_us = end_ns // 1000
        for name, section in self.site.sections.items():
            members = tuple((self.site.sensors[i][0], self.centre) for i in sorted(self.site.kinds[name]))
            yield Flow(section.sensing.longest(), members)
        if sync_of(self.scenario, self.site.sensors[0][0]):
            yield Flow(SyncRequest(65535, now_us), there)
            yield Flow(SyncReply(65535, now_us, now_us, now_us), back)
        if _threshold(self.site):
            yield Flow(Threshold(65535, 70.0), back)


def _threshold_db(site: Site, index: int) -> Mapping[str, float]:
    """The level above which a sensor reports, if its kind has thresholds."""
    kind = site.sections[site.kind_of(index)].sensing
    return {} if kind.thresholds is None else {"threshold_db": kind.threshold}


def _threshold(site: Site) -> Mapping[str, float] | None:
    """The bounds and the start of the threshold that the centre sets, and its reach; None: it sets none."""
    kind = adaptive(site.scenario)
    if kind is None or kind.thresholds is None:
        return None
    low, high = kind.thresholds
    return {
        "low_db": low,
        "high_db": high,
        "start_db": kind.threshold,
        "target_sd_m": site.scenario.fusion.target_sd_m,
        "reach_m": kind.range_m,
    }
