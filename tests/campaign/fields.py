"""Fields of sensors that track a target: the scenario of a seed, and its faults."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

from launcher.plan.prepare import planned
from launcher.records import Plan
from tests.campaign.draws import LINKS, Draw
from trackfield.errors import ScenarioError
from trackfield.filters.trackers import TRACKERS
from trackfield.scenario import Scenario

SPACING_M: Final = 50.0
KINDS: Final = ("kill", "freeze", "restart", "partition", "stuck", "bias", "deaf", "babble", "clock_jump")
OF_SENSORS: Final = ("stuck", "bias", "deaf", "babble")
SENSING: Final[dict[str, Callable[[Draw], dict[str, Any]]]] = {
    "doa": lambda draw: {
        "threshold": draw.choice([0.7, 0.75, 0.78, "adaptive"]),
        "level_sd_db": draw.choice([0.0, 1.0]),
    },
    "range": lambda draw: {"range_m": draw.choice([60.0, 100.0]), "growth_m": draw.choice([0.0, 0.05])},
    "rss": lambda draw: {
        "range_m": draw.choice([60.0, 100.0]),
        "shadow_sd_db": draw.number(1, 6),
        "slow": draw.choice([0.0, 0.5]),
        "fixed": draw.choice([0.0, 0.5]),
    },
    "energy": lambda draw: {
        "range_m": draw.choice([60.0, 100.0]),
        "window_s": draw.choice([0.0, 1.0, 3.0]),
        "sound_m_s": draw.choice([0.0, 1000.0]),
    },
}
"""What sensors measure, and the options of that."""


def settings(seed: int) -> dict[str, Any]:
    """Keys of the scenario; faults that contradict earlier ones are left out."""
    draw = Draw(seed)
    side, steps = draw.randint(5, 8), draw.randint(15, 30)
    settings = dict(surroundings(draw, side, steps)) | {"seed": seed}
    sensing = settings["sensor.kind"]
    ids = [place.id for place in field(settings).info.places if place.role == "node"]
    faults: list[dict[str, Any]] = []
    wanted = draw.randint(1, 6)
    while len(faults) < wanted:
        one = fault(draw, ids, steps, sensing)
        field({**settings, "faults": [one]})
        try:
            field({**settings, "faults": [*faults, one]})
        except ScenarioError:
            continue
        faults.append(one)
    return {**settings, "faults": faults}


def field(settings: dict[str, Any]) -> Plan:
    """The plan of a scenario."""
    return planned(Scenario.load({"name": "campaign"}, settings, known_trackers=TRACKERS))


def surroundings(draw: Draw, side: int, steps: int) -> Iterator[tuple[str, Any]]:
    """All of a scenario but its faults."""
    extent = (side - 1) * SPACING_M
    yield "field.layout", draw.choice(["grid", "jittered", "random"])
    yield "field.spacing_m", SPACING_M
    yield "field.extent_m", extent
    sensing = draw.choice(["doa", *SENSING])
    yield "sensor.kind", sensing
    for key, value in SENSING[sensing](draw).items():
        yield f"sensor.{key}", value
    yield "target.path", "waypoints"
    yield "target.waypoints", route(draw, extent, steps)
    more = [] if sensing == "energy" else draw.maybe(0.15, lambda: "spcpf")  # which takes no unknowns
    yield "fusion.trackers", ["imm-ukf", *more]
    yield "fusion.deadline_s", draw.choice([0.1, 0.3, 0.9])
    yield "fusion.max_age_s", draw.choice([0.0, 0.0, 1.5, 4.0])
    yield "fusion.prior", draw.choice(["paper", "none"])
    for path in draw.maybe(0.2, lambda: route(draw, extent, steps)):
        yield "fusion.path", path
    link = LINKS[draw.choice(sorted(LINKS))](draw)
    for loss in draw.maybe(0.2, lambda: draw.number(0.05, 0.4)):
        link |= {"burst_loss": loss, "burst_s": draw.choice([0.5, 3.0])}
    for key, value in link.items():
        yield f"link.{key}", value
    if link["model"] == "lognormal_prr":
        for name in ("node", "fusion"):
            for tx_dbm in draw.maybe(0.3, lambda: draw.choice([-10.0, -3.0, 0.0])):
                yield f"radio.{name}.tx_dbm", tx_dbm
    if draw.random() < 0.6:
        yield "clock.offset_ms", draw.choice([0.5, 20.0, 400.0, 3000.0])
        yield "clock.drift_ppm", draw.choice([0.0, 20.0, 500.0])
        yield "clock.ramp_ppm_per_h", draw.choice([0.0, 50.0])
        yield "clock.sync", draw.random() < 0.8
        yield "clock.exchanges", draw.randint(1, 8)
        yield "clock.resync_s", draw.choice([1.0, 7.0, 60.0])
    if draw.random() < 0.5:
        yield "energy.battery_j", round(10 ** draw.uniform(-1.3, 0.7), 4)
        yield "energy.sample_mj", draw.choice([0.0, 1.0])
        for joules in draw.maybe(0.2, lambda: draw.number(0.3, 3.0)):
            yield "energy.centre_battery_j", joules


def route(draw: Draw, extent: float, steps: int) -> list[list[float]]:
    """Straight legs through the field that last as long as the run."""
    times = [0.0, *sorted(draw.sample(range(2, steps - 1), draw.randint(0, 2))), float(steps)]
    return [[float(t), draw.number(0, extent), draw.number(0, extent)] for t in times]


def fault(draw: Draw, ids: Sequence[str], steps: int, sensing: str) -> dict[str, Any]:
    """One fault, of sensors of a kind or, where it can be, of the centre too."""
    kind = draw.choice(KINDS)
    fault: dict[str, Any] = {"kind": kind, "at_s": draw.number(0.5, steps - 2)}
    if draw.random() < 0.3:
        fault["share"] = draw.choice([0.1, 0.3, 0.6])
    else:
        centre = [] if kind in OF_SENSORS else ["fusion"]
        fault["nodes"] = sorted(draw.sample([*ids, *centre * 10], draw.randint(1, 3))[:1])
        fault["nodes"] = sorted({*fault["nodes"], *draw.sample(list(ids), draw.randint(0, 2))})
    if kind == "clock_jump":
        fault["jump_ms"] = draw.choice([-1, 1]) * draw.choice([20.0, 700.0, 1000.0, 4000.0])
    if kind == "bias" and sensing != "doa":
        fault["by"] = [draw.choice([-30.0, -5.0, 5.0, 1e6])]
    elif kind == "bias":
        fault["bias_deg"] = draw.choice([-20.0, 20.0, 170.0])
        fault["bias_db"] = draw.choice([-5.0, 0.0, 5.0])
    if kind in ("freeze", "restart", "partition") or (kind in OF_SENSORS and draw.random() < 0.5):
        fault["until_s"] = round(min(fault["at_s"] + draw.choice([1.0, 2.5, 10.0]), steps), 3)
    return fault
