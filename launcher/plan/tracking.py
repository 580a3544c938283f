"""The arguments of a ``trackfield.tracking.bank.Bank``, the same for every process that tracks."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from launcher.plan.extensions import check_kinds, check_sensing, check_trackers
from trackfield.draw import normal
from trackfield.errors import ScenarioError, together
from trackfield.filters.solving.solver import Solver
from trackfield.filters.trackers import make_tracker
from trackfield.role import NS
from trackfield.scenario import Scenario, Site
from trackfield.scenario.architectures.cpa import CPA
from trackfield.scenario.options import tables
from trackfield.scenario.survey import named
from trackfield.tracking.smoothing import lagged_names, rts_names, spline_name


def tracking_of(site: Site, source: str) -> dict[str, Any]:
    """For the process ``source``, the first that tracks: its prior is drawn by its id.

    Raises ``ScenarioError`` for trackers and sensors that do not fit each other.
    """
    scenario = site.scenario
    check_kinds(scenario)
    check_sensing(scenario, site.sections)
    return {
        "trackers": list(scenario.fusion.trackers),
        "sensors": [list(place) for place in site.believed],
        "step_ns": site.step_ns,
        "sensing": {name: section.plain for name, section in site.sections.items()},
        "seed": scenario.seed,
        "prior": _prior(site, source),
        "sigma_v": scenario.fusion.sigma_v,
        "lost_m": scenario.fusion.lost_m,
        "speed_sd": scenario.fusion.speed_sd,
        "assumed_noise": scenario.fusion.assumed_noise,
        **if_used(
            options=tables(scenario.fusion.options),
            smooth_lag=scenario.fusion.smooth_lag,
            origin_ns=site.origin_ns,
            kinds=_kinds(site),
        ),
    }


def check_tracking(scenario: Scenario) -> None:
    """Raise ``ScenarioError`` for unknown trackers and sensors, and for those that do not fit each other.

    With groups of sensors, whether any are left for ``[sensor]`` shows only in the field.
    """
    checks: list[Callable[[], object]] = [partial(check_trackers, scenario.fusion), partial(check_kinds, scenario)]
    if not scenario.sensors:
        checks.append(partial(check_sensing, scenario, named(scenario)))
    together(checks)


def track_names(scenario: Scenario) -> tuple[str, ...]:
    """The names of all tracks, smoothed ones last."""
    names, options = scenario.fusion.trackers, tables(scenario.fusion.options)
    made = [(name, make_tracker(name, options.get(name))) for name in names]
    return (*names, *lagged_names(made, scenario.fusion.smooth_lag), *whole_names(scenario, made))


def whole_names(scenario: Scenario, made: Sequence[tuple[str, object]]) -> tuple[str, ...]:
    """The names of the tracks that a base smooths as a whole; where it is told of fixes, of the solvers only."""
    if not scenario.fusion.smooth_rts:
        return ()
    if scenario.architecture.kind != CPA:
        return rts_names(made)
    return tuple(spline_name(name) for name, tracker in made if isinstance(tracker, Solver))


def rts_of(site: Site) -> dict[str, Any]:
    """The arguments with which a base (``fusion.base.Base``) smooths whole tracks, if it is to."""
    return {"rts": True, "last_step": site.steps} if site.scenario.fusion.smooth_rts else {}


def spline_of(site: Site) -> dict[str, Any]:
    """The arguments with which a base that is told of fixes (``fusion.sink.Sink``) smooths whole tracks."""
    return {"spline": True, "last_step": site.steps} if site.scenario.fusion.smooth_rts else {}


def if_used(**more: Any) -> dict[str, Any]:
    """The settings that are on: roles have them off by default, which keeps the configuration of many nodes small."""
    return {name: value for name, value in more.items() if value}


def _kinds(site: Site) -> dict[str, list[str]]:
    """Which sensors are of which kind, of several kinds."""
    ids = [id for id, *_ in site.sensors]
    several = len(site.kinds) > 1
    return {name: [ids[i] for i in sorted(members)] for name, members in site.kinds.items()} if several else {}


def _prior(site: Site, source: str) -> Mapping[str, Sequence[float]] | None:
    """Zhai et al.: the initial estimate is drawn around the truth (of the first target), for each run again.

    Raises ``ScenarioError`` if nobody knows where that is.
    """
    scenario = site.scenario
    if scenario.fusion.prior == "none":
        return None
    if not site.paths:
        what = f"is {scenario.fusion.prior!r}, around where the target is, and the recording does not tell"
        raise ScenarioError(what, key="fusion.prior", expected="'none'")
    truth, sd = next(iter(site.paths.values())).at(site.origin_ns / NS), scenario.fusion.prior_sd
    if truth is None:
        return None
    draws = [normal(scenario.seed, source, "prior", i) for i in range(len(sd))]
    return {"mean": [x + s * z for x, s, z in zip(truth, sd, draws, strict=True)], "sd": list(sd)}
