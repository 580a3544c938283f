"""What a scenario's processes run on: their clocks and how they set them, their batteries."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from typing import Any, Final

from launcher.plan.links import section_of
from trackfield.draw import normal
from trackfield.errors import ScenarioError
from trackfield.link.energy import DEVICES, NODE_UW, SENDING_UW, sending_at
from trackfield.link.fate import FIELD
from trackfield.link.radios import RADIOS
from trackfield.link.trace import has_ratios
from trackfield.protocols.collection.piece import LEAST_NS, MOST_NS
from trackfield.protocols.timesync import SPREAD_NS
from trackfield.role import NS
from trackfield.scenario import Scenario, Site
from trackfield.scenario.links import Csma154, Ethernet, Fixed, GilbertElliott, LinkSection, LognormalPrr, Trace
from trackfield.scenario.radios import OwnRadio
from trackfield.scenario.sensors import SensorSection
from trackfield.sensing.complete import Kind
from trackfield.wire.keys import Medium

FJ_PER_UJ: Final = 10**9
FJ_PER_MJ: Final = 10**12
DEVICE_OF: Final = {"802154-0dbm": "cc2420", "802154-20dbm": "cc2420-20dbm", "lora868": "sx1276", "wifi11b": "wifi11b"}
"""The device that has this radio; for any other, the figures of a CC2420."""
DRAWS: Final = ("send_uw", "receive_uw", "listen_uw", "sleep_uw")
PATIENCE_NS: Final = NS // 10
"""Time allowed for an exchange, or for a command, besides the link's own delays."""
HOP_PATIENCE_NS: Final = NS // 50
"""Time allowed for a message over a hop and its acknowledgement, besides the link's own delays."""
COMMANDS: Final = 32
"""Sensors that may have to be told a threshold one after another, by the centre's one radio."""
ROOM: Final = 3
"""The shortest interval between the beacons of a tree is so many times what those of all its processes take."""
JITTERS: Final = 5
"""In units of its mean: one exponential delay in 150 is longer."""
GUARD_SDS: Final = 3
"""A node listens long enough if its clock is off by no more than so many standard deviations."""
SYNC_BYTES: Final = 64
"""At least the length of the longest message that sets clocks (docs/wire.md)."""


def clock_of(scenario: Scenario, id: str) -> dict[str, int]:
    """The clock of process ``id``: how far it is off, drawn for this process alone; nothing if clocks are right.

    For every process but the one whose clock is the run's reference, which an architecture chooses.
    """
    clock, seed = scenario.clock, scenario.seed
    if not clock.off:
        return {}
    return {
        "offset_ns": round(clock.offset_ms * 1e6 * normal(seed, id, "clock", "offset")),
        "drift_ppb": round(clock.drift_ppm * 1e3 * normal(seed, id, "clock", "drift")),
        "ramp_ppb_per_h": round(clock.ramp_ppm_per_h * 1e3),
    }


def tree_of(scenario: Scenario, base: str, size: int, *, queue: int, announces: bool) -> dict[str, Any]:
    """How a process is in the tree to a ``base``: the arguments of its ``Collected`` (``trackfield/protocols``).

    It waits for an acknowledgement as long as that and the message may take on a link that is sending other messages
    already; on slow radios beacons come at intervals that are longer by as much. Radios that do not listen before they
    send need more room: ``ROOM`` times that of all processes of the tree, of which there are ``size``.
    """
    patience_ns = HOP_PATIENCE_NS + 4 * slowest_ns(scenario, repeats=1)
    least_ns = max(LEAST_NS, 4 * patience_ns)
    if _blind(scenario.link):
        least_ns = max(least_ns, ROOM * size * slowest_ns(scenario, repeats=1))
    return {
        "base": base,
        "seed": scenario.seed,
        "patience_ns": patience_ns,
        "least_ns": least_ns,
        "most_ns": MOST_NS * max(least_ns // LEAST_NS, 1),
        "queue": queue,
        "announces": announces,
    }


def _blind(link: LinkSection) -> bool:
    """Whether its radio does not listen before it sends."""
    return isinstance(link, LognormalPrr) and RADIOS[link.radio](link.sf or 9).access.blind_ns is None


def sync_of(
    scenario: Scenario, id: str, reference: str, hops: int = 1, medium: Medium = FIELD
) -> dict[str, Any] | None:
    """How process ``id`` sets its clock by asking ``reference``, the ``sync`` of its role; None if it never does.

    These are the fields of ``Rounds`` (``trackfield/protocols/timesync.py``). The reference is any process that tells
    the time: the one whose clock is right, or one that asks another in turn, over so many ``hops`` of this ``medium``.
    """
    clock = scenario.clock
    if not (clock.sync and clock.off):
        return None
    return {
        "reference": reference,
        "exchanges": clock.exchanges,
        "resync_ns": round(clock.resync_s * NS),
        "timeout_ns": PATIENCE_NS + 2 * hops * slowest_on(section_of(scenario, medium)),
        "seed": scenario.seed,
        "id": id,
        **({} if medium == FIELD else {"medium": medium}),
    }


def following_of(sync: Mapping[str, Any] | None) -> dict[str, int]:
    """How roles follow the clock of their process, which another one sets by asking in this way (None: it is right).

    These are the fields of ``Following``: by then its first round is over.
    """
    return {"follows_ns": 0 if sync is None else SPREAD_NS + sync["exchanges"] * sync["timeout_ns"]}


def duty_of(site: Site) -> dict[str, int] | None:
    """When a sensor node that is awake listens for its threshold; None if it is never told one."""
    if adaptive(site.sections) is None:
        return None
    scenario, step_ns, guard_ns = site.scenario, site.step_ns, _guard_ns(site.scenario, site.end_ns)
    match scenario.link:
        case LognormalPrr() | Csma154():
            window_ns = PATIENCE_NS + COMMANDS * slowest_ns(scenario)
        case Trace():
            window_ns = step_ns  # measured delays may have any length
        case _:
            window_ns = PATIENCE_NS + slowest_ns(scenario)
    return {
        "listen_from_ns": site.origin_ns + round(scenario.fusion.deadline_s * NS) - guard_ns,
        # At most until it listens again: a threshold that comes after the next step's instant counts for later steps.
        "listen_for_ns": min(window_ns + 2 * guard_ns, step_ns),
    }


def adaptive(sections: Mapping[str, SensorSection]) -> Kind | None:
    """The kind of sensing whose threshold is set by whoever tracks; None if there is none.

    Raises ``ScenarioError`` if it is one of several kinds: a threshold holds for all sensors.
    """
    kinds = [section.sensing for section in sections.values()]
    found = next((kind for kind in kinds if kind.adaptive), None)
    if found is not None and len(kinds) > 1:
        what = f"sensors of kind '{found.name}' have an adaptive threshold, and there are others"
        raise ScenarioError(what, key="sensors", expected="a fixed threshold, or sensors of one kind")
    return found


def _guard_ns(scenario: Scenario, end_ns: int) -> int:
    """How far off a node assumes its clock to be, if it never sets it."""
    clock = scenario.clock
    return 0 if clock.sync else round(GUARD_SDS * (clock.offset_ms * 1e6 + clock.drift_ppm * 1e-6 * end_ns))


def slowest_ns(scenario: Scenario, repeats: int | None = None) -> int:
    """How long a message that sets clocks may take on an idle channel; 0 if unknown.

    It is sent so many times (None: as often as the link says).
    """
    return slowest_on(scenario.link, repeats)


def slowest_on(link: LinkSection, repeats: int | None = None) -> int:
    """The same on any link."""
    match link:
        case Fixed() | Ethernet():
            return round(link.delay_ms * 1e6)
        case GilbertElliott():
            return round((link.delay_ms + JITTERS * link.jitter_ms) * 1e6)
        case Trace() if not has_ratios(link.file):
            return 0
        case LognormalPrr() | Csma154() | Trace():
            radio = RADIOS[link.radio](link.sf or 9) if isinstance(link, LognormalPrr) else RADIOS["802154-0dbm"](0)
            one = radio.airtime_ns(radio.overhead_bytes + SYNC_BYTES) + radio.patience_ns
            return one * max(repeats or (radio.ack if link.ack is None else link.ack), 1)
    return 0


def power_of(scenario: Scenario, battery_j: float | None, sample_fj: int, own: OwnRadio, key: str) -> dict[str, Any]:
    """What a process draws whose radio has this of its ``own``, and what its battery holds (None: it runs on mains).

    Raises ``ScenarioError``, under the ``key`` of that power, if its device cannot send with it.
    """
    link = scenario.link
    device = own.device or scenario.energy.device or _device_of(link)
    if own.tx_dbm is not None and own.tx_dbm > (most_dbm := SENDING_UW[device][-1][0]):
        what = f"is {own.tx_dbm:g}, and the device {device} has at most {most_dbm:g}"
        raise ScenarioError(what, key=key, expected=f"at most {most_dbm:g}, or another device")
    tx_dbm = own.tx_dbm if own.tx_dbm is not None else link.tx_dbm if isinstance(link, LognormalPrr) else None
    power = DEVICES[device] if tx_dbm is None else sending_at(device, tx_dbm)
    battery_fj = None if battery_j is None else round(battery_j * 1e6) * FJ_PER_UJ
    return asdict(replace(power, sample_fj=sample_fj, battery_fj=battery_fj))


def without_radio(power: Mapping[str, Any]) -> dict[str, Any]:
    """What a process draws that has no radio of the field: its processor, whatever it does."""
    return {**power, **dict.fromkeys(DRAWS, NODE_UW)}


def devices_of(sections: Mapping[str, LinkSection], media: Iterable[str]) -> dict[str, dict[str, Any]]:
    """What the radios of other ``media`` than the field draw, besides the processor, which is with that of the field.

    A wire is taken to draw nothing.
    """
    radios = {medium: sections[medium] for medium in media if medium != FIELD}
    return {
        medium: _radio_alone(_device_of(one))
        for medium, one in radios.items()
        if isinstance(one, LognormalPrr | Csma154)
    }


def _device_of(link: LinkSection) -> str:
    return DEVICE_OF.get(link.radio if isinstance(link, LognormalPrr) else "", "cc2420")


def _radio_alone(device: str) -> dict[str, Any]:
    power, less_uw = DEVICES[device], 0 if device == "wifi11b" else NODE_UW
    return asdict(replace(power, **{name: getattr(power, name) - less_uw for name in DRAWS}))
