"""The field that an architecture arranges, and Trackfield's own processes for it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from launcher.plan.architectures.arranged import Process
from launcher.plan.hardware import adaptive, duty_of
from launcher.plan.tracking import if_used
from launcher.records import BATTERY, TRACKS
from trackfield.errors import ScenarioError
from trackfield.role import NS
from trackfield.scenario import Scenario, Site
from trackfield.wire.registry import kind_of_class

NODE: Final = "node"
CENTRE: Final = "fusion"
"""The role of a fusion centre, whatever its id."""


@dataclass(frozen=True)
class Field:
    """A surveyed field, as an architecture sees it; ``site`` has the rest, such as the scenario and its seed.

    Its methods make processes that behave as those of ``centralised`` do: as the scenario's sections say.
    """

    site: Site

    @property
    def scenario(self) -> Scenario:
        """What was surveyed."""
        return self.site.scenario

    @property
    def sensors(self) -> tuple[tuple[str, float, float], ...]:
        """(id, m east, m north) of each sensor."""
        return self.site.sensors

    @property
    def centre(self) -> tuple[float, float]:
        """Where the scenario has its fusion centre, or else the middle of the field (m east, north)."""
        return self.site.centre

    @property
    def route(self) -> tuple[tuple[int, float, float], ...]:
        """How the scenario's fusion centre moves, as ``Process`` has it; empty if it does not."""
        return self.site.route

    @property
    def numbering(self) -> dict[str, Any]:
        """The arguments of a ``trackfield.tracking.forwarding.Numbering``, for whoever takes tracks by radio."""
        site = self.site
        return {
            "trackers": list(self.scenario.fusion.trackers),
            "sensors": self._ids,
            "step_ns": site.step_ns,
            "origin_ns": site.origin_ns,
        }

    @property
    def _ids(self) -> list[str]:
        return [id for id, *_ in self.sensors]

    def sensor_nodes(
        self, reports_to: str, ids: Collection[str] | None = None, *, asks: str | None = None
    ) -> list[Process]:
        """The nodes at the sensors with these ``ids`` (None: at all), which report to one process.

        They ask that process for the time, unless ``asks`` names another.
        """
        wanted = None if ids is None else frozenset(ids)
        nodes = {name: self._node(name, reports_to, asks) for name in self.site.sections}
        return [
            replace(nodes[self.site.kind_of(index)], id=id, x=x, y=y)
            for index, (id, x, y) in enumerate(self.sensors)
            if wanted is None or id in wanted
        ]

    def _node(self, kind: str, reports_to: str, asks: str | None) -> Process:
        """A node whose sensor is of this kind; values that are the same for all nodes are shared."""
        site, sensing = self.site, self.site.sections[kind].sensing
        config: dict[str, Any] = {
            "step_ns": site.step_ns,
            **({} if sensing.thresholds is None else {"threshold_db": sensing.threshold}),
            "centre": reports_to,
            **if_used(
                origin_ns=site.origin_ns,
                adaptive=duty_of(site),
                by_itself=sensing.rhythm == "events",
            ),
        }
        return Process(
            "",
            NODE,
            0.0,
            0.0,
            config=config,
            sends={kind_of_class(sensing.message).name: (reports_to,)},
            senses=True,
            asks=reports_to if asks is None else asks,
            tags=(BATTERY,),
            battery_j=self.scenario.energy.battery_j,
        )

    def fusion_centre(
        self,
        id: str,
        x: float,
        y: float,
        sensors: Collection[str],
        *,
        asks: str = "",
        forwards_to: str = "",
        route: Sequence[tuple[int, float, float]] = (),
    ) -> Process:
        """A fusion centre that tracks with the reports of these sensors; ``asks`` and ``route`` as in ``Process``.

        It sends its tracks by radio to the process that it ``forwards_to``, if any, in messages ``track``. Raises
        ``ScenarioError`` if there are no sensors.
        """
        if not sensors:
            expected = "at least one sensor that reports to it"
            raise ScenarioError("would fuse the reports of no sensor", key=f"fusion centre {id!r}", expected=expected)
        fusion, energy = self.scenario.fusion, self.scenario.energy
        threshold = _threshold(self.site)
        forward = {"to": forwards_to, "sensors": self._ids} if forwards_to else None
        config: dict[str, Any] = {
            "deadline_ns": round(fusion.deadline_s * NS),
            **if_used(max_age_ns=round(fusion.max_age_s * NS), threshold=threshold, forward=forward),
        }
        return Process(
            id,
            CENTRE,
            x,
            y,
            config=config,
            sends=if_used(threshold=sensors if threshold else (), track=(forwards_to,) if forward else ()),
            fuses=sensors,
            asks=asks,
            tags=(TRACKS,) if energy.centre_battery_j is None else (TRACKS, BATTERY),
            battery_j=energy.centre_battery_j,
            route=route,
        )


def _threshold(site: Site) -> Mapping[str, float] | None:
    """The bounds and the start of the threshold that the centre sets, and its reach; None: it sets none."""
    kind = adaptive(site.sections)
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
