"""Figures of a run in words, for a terminal and for a report alike."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from launcher.record.figures.channel import is_fiction, lost_share

_LONGER: Final = (("years", 365.25 * 86_400), ("days", 86_400), ("h", 3_600), ("min", 60))
_JOULES: Final = (("GJ", 1e9), ("MJ", 1e6), ("kJ", 1e3), ("J", 1.0), ("mJ", 1e-3), ("µJ", 1e-6), ("nJ", 1e-9))

MOST_TOLD: Final = 5
"""Of more certificates, what the first so many tried is told."""
FATES: Final[Mapping[str, str]] = {
    "late": "after the deadline",
    "ignored": "ignored",
    "radio": "lost on the link",
    "partition": "cut off by a partition",
    "in_flight": "still on the way at the end of the run",
    "asleep": "to a receiver that was off",
    "frozen": "to a frozen receiver",
    "dead": "to a dead receiver",
    "overflow": "never sent, as the queue was full",
    "container": "cut off with a container, as planned",
    "host_lost": "lost by the machine itself",
    "host_late": "too late on this machine to be handled",
}
"""What became of a frame that was of no use in time."""


def span(seconds: float) -> str:
    """A duration in the unit that suits it, from parts of a second to years: ``40 s``, ``1.5 h``, ``23 days``."""
    for unit, length in _LONGER:
        if seconds >= 2 * length:
            return f"{_digits(seconds / length)} {unit}"
    return f"{_digits(seconds)} s"


def joules(energy_j: float) -> str:
    """An energy in the unit that suits it: ``8.58 kJ``, ``456 mJ``."""
    for unit, size in _JOULES:
        if abs(energy_j) >= size:
            return f"{_digits(energy_j / size)} {unit}"
    return f"{energy_j:.3g} J"


def _digits(value: float) -> str:
    """Three digits, and all before the point."""
    return f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"


def led(metrics: Mapping[str, Any]) -> list[str]:
    """Who led, which slaves have no master, and how old what the base knew was, a line each; none without masters."""
    leaders, clusters, age = (metrics[key] for key in ("leaders", "clusters", "age_of_information_s"))
    found = []
    if leaders["per_step_mean"] is not None:
        elections = _many(leaders["elections"], "election")
        elected = f"{elections} ({leaders['split_elections']} split), " if leaders["elections"] else ""
        asked = "" if leaders["reports_asked"] is None else f" of {leaders['reports_asked']:.1f} asked for"
        used = "" if leaders["reports_used"] is None else f"; {leaders['reports_used']:.1f} reports a step{asked}"
        handed = leaders["handovers"]
        over = "" if handed is None else f"{_many(handed, 'hand-over')} ({leaders['lost_handovers']} more lost), "
        found.append(
            f"leaders: {over}"
            f"{_many(leaders['take_overs'], 'take-over')} ({leaders['false_take_overs']} false), {elected}"
            f"two at once in {_many(leaders['two_leader_steps'], 'step')}{used}"
        )
    if clusters["orphans_first"] is not None:
        first, last = clusters["orphans_first"], clusters["orphans_last"]
        found.append(f"slaves without a master: {first} at the first step, {last} at the end")
    if age["mean"] is not None:
        found.append(f"what the base knew was {span(age['mean'])} old, mean; {span(age['p95'])}, 95 %")
    return found


def passed(metrics: Mapping[str, Any]) -> list[str]:
    """How often targets passed, and what each tracker made of it, a line each; none where sensors report no passes."""
    passes = metrics["passes"]
    events = f"passes: {_many(passes['events'], 'event')}, {passes['enough']} with reports enough for a fix"
    found = [events] if passes["events"] else []
    for name, one in passes["trackers"].items():
        if not one["fixes"] and not one["refused"]:
            continue
        refused = sum(one["refused"].values())
        off = ""
        if one["location_m"]["mean"] is not None:
            errors = one["location_m"]["mean"], one["speed_m_s"]["mean"], one["heading_deg"]["mean"]
            off = "; off by {:.2f} m, {:.2f} m/s, {:.1f}°, mean".format(*errors)
            off += f", {span(one['delay_s']['mean'])} after the last pass"
        false = "" if one["false_fixes"] is None else f" ({one['false_fixes']} false)"
        found.append(f"{name}: {_many(one['fixes'], 'fix', 'es')}{false}, {refused} refused{off}")
    return found


def filmed(metrics: Mapping[str, Any]) -> list[str]:
    """What a camera beyond the gateway saw, a line each; none without a camera."""
    camera = metrics["camera"]
    if camera is None:
        return []
    seen, gateway, lost = camera["in_frame"], camera["gateway"], camera["lost"]
    found = f"camera: {_many(camera['shots'], 'shot')} of {_many(camera['fixes'], 'fix', 'es')}"
    if seen["at_aim"] is not None:
        inside = round(seen["at_aim"] * seen["aims"])
        found += f"; target in the picture at {inside} of {_many(seen['aims'], 'aim')}"
    if seen["frames"] is not None:
        found += f", in {seen['frames']:.0%} of {_many(seen['frames_n'], 'frame')}"
    if camera["delay_s"]["mean"] is not None:
        found += f"; {span(camera['delay_s']['mean'])} from the last pass to the camera, mean"
    if lost["times"]:
        found += f"; lost {_many(lost['times'], 'time')}, for {span(lost['s'])}"
    said = ", ".join(f"{gateway[name]} {name}" for name in ("passed", "refused", "dropped", "unwanted"))
    orders = ", ".join(f"{n} {answer}" for answer, n in camera["orders"].items() if n)
    return [found, f"gateway: {said}, at most {gateway['queue_max']} waited{'; orders: ' if orders else ''}{orders}"]


def _many(count: int, what: str, more: str = "s") -> str:
    return f"{count:,} {what}{more * (count != 1)}"


def losses(fates: Mapping[str, int | None]) -> str:
    """What became of frames that did not come in time, in words."""
    return ", ".join(f"{n:,} {FATES.get(name, name)}" for name, n in fates.items() if n and name != "delivered")


def uninformed(metrics: dict[str, Any]) -> str:
    """What it means that no report arrived; a tracker that has a track even so has it from its prior."""
    tracked = any(tracker["steps_tracked"] for tracker in metrics["trackers"].values())
    return f"no tracker had any report{', only its prior' if tracked else ''}"


INTERFERENCE: Final = {
    "frames": "frames in the name of processes that did not send them",
    "telemetry": "pieces of telemetry that no process of the run sent",
    "answers": "answers in the launcher's place",
    "orders": "orders that the launcher did not give",
    "tokens": "liveliness tokens of no process of the run",
    "questions": "questions without the seal of the run",
    "denied": "messages that the router refused",
    "handshakes": "connections without a valid certificate of the run",
    "sessions": "second sessions with one certificate",
}
"""What others did in a run, by the keys of ``interference``."""


def interference(counts: Mapping[str, int]) -> str:
    """What others did in the run; empty if nothing."""
    return ", ".join(f"{n} {INTERFERENCE[kind]}" for kind, n in counts.items() if n)


def attempted(attempts: Mapping[str, Mapping[str, int]]) -> str:
    """What the router refused, in brackets: by certificate, of each kind how often; empty if nothing."""
    told = [f"{name} {', '.join(f'{kind} {n}' for kind, n in kinds.items())}" for name, kinds in attempts.items()]
    more = f"; and {len(told) - MOST_TOLD} more" if len(told) > MOST_TOLD else ""
    return f" ({'; '.join(told[:MOST_TOLD])}{more})" if told else ""


def alarms(metrics: dict[str, Any]) -> list[str]:
    """What makes a run's figures doubtful."""
    found = []
    frames, timing = metrics["frames"], metrics["timing"]
    if timing["host_late"]:
        found.append(
            f"timing: {timing['host_late']} events came too late on this machine to be handled in order "
            "(timing.host_late): a machine with less to do, a lower --speed or --virtual is exact"
        )
    if timing["unsettled"]:
        found.append(
            f"timing: {timing['unsettled']} processes were not settled when the run was ended (timing.unsettled): "
            "frames may have been taken back after that"
        )
    if timing["foreign_corrections"]:
        found.append(
            f"timing: {timing['foreign_corrections']} frames to foreign devices were taken back or replaced "
            "(timing.foreign_corrections): what a device did in reaction to them stands"
        )
    if is_fiction(metrics):
        found.append(
            "the losses of this run are a fiction: frames do not collide in the model. About "
            f"{metrics['channel']['spared_share']:.1%} of them would have been lost by that, or as their receiver was "
            f"sending (channel.spared_share), the channel was in use for {metrics['channel']['use_mean']:.1%} of the "
            f"run, and the model lost {lost_share(frames):.1%} on its links"
        )
    if frames["expected"] and not frames["delivered"]:
        lost = losses({**frames["lost"], **{key: frames[key] for key in ("host_lost", "host_late")}})
        found.append(f"none of {frames['expected']:,} frames arrived ({lost}): {uninformed(metrics)}")
    if not frames["expected"]:
        found.append(f"no frame was sent: {uninformed(metrics)}")
    return found
