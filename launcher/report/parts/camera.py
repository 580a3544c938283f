"""A camera beyond the gateway: each shot beside the truth, where the camera looked, and how fixes came to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from launcher.outside import AIMED, CAMERA, CONTROL, FORWARDER, GATEWAY, Aim
from launcher.outside import VIDEO as CAPTURES
from launcher.record.figures.camera.judged import Judge, Shot
from launcher.record.outside.filmed import SHEET, VIDEO
from launcher.record.words import span
from launcher.report import style
from launcher.report.cells import NOTHING, Table, number, percent
from launcher.report.folder import Run
from launcher.report.parts import pointing
from launcher.report.parts.machine import Line
from trackfield.role import NS

MOST_SHOTS: Final = 40
"""Of more fixes the first ones are listed."""
LARGEST: Final = 8_000_000
"""The most bytes of a picture that is put on the page."""
SPREADS: Final = {
    "delay_s": ("from the last pass to the arrival of the fix", "s"),
    "slew_s": ("turning", "s"),
    "first_seen_s": ("from the last pass to the first frame with the target", "s"),
    "place_m": ("from where it aims to the target", "m"),
    "pan_deg": ("off in pan at the aim", "°"),
    "tilt_deg": ("off in tilt at the aim", "°"),
}
CARRIERS: Final = ("carried", "item", "visca", "capture")
"""What takes a fix from the gateway to a camera that turns."""


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    if run.outside is None:
        return {
            "verdict": "",
            "lines": [],
            "spreads": Table([], []),
            "shots": Table([], []),
            "more": 0,
            "ways": Table([], []),
            "video": "",
        }
    return {
        "verdict": verdict(run.metrics["camera"]),
        "lines": lines(run.metrics["camera"]),
        "spreads": spreads(run.metrics["camera"]),
        "shots": shots(run),
        "more": max(len(run.outside.aims) - MOST_SHOTS, 0),
        "ways": ways(run),
        "video": VIDEO if _there(run.folder / VIDEO) else "",
    }


def judge(run: Run) -> Judge | None:
    """The shots of a run beside the truth; None without a camera."""
    end_ns = run.site.origin_ns + round(run.metrics["ended_s"] * NS)
    return None if run.outside is None else Judge(run.outside, run.site.paths, end_ns)


def sheet(run: Run) -> bytes | None:
    """The picture with a frame of each shot; None if there is none, or it cannot be read."""
    with suppress(OSError):
        file = run.folder / SHEET
        if run.outside is not None and _there(file) and file.stat().st_size <= LARGEST:
            return file.read_bytes()
    return None


def _there(file: Path) -> bool:
    try:
        return file.is_file()
    except OSError:
        return False


# --- words ------------------------------------------------------------------------------------------------------------


def verdict(camera: Mapping[str, Any]) -> str:
    """What came of it, in a sentence or two."""
    seen, lost = camera["in_frame"], camera["lost"]
    if not camera["fixes"]:
        said = "No fix came to camera control, so the camera was never aimed"
    elif not camera["shots"]:
        said = "The camera was never aimed, though fixes came"
    elif seen["at_aim"] is None:
        said = "Of none of the shots it can be said whether the target was in the picture"
    else:
        inside = round(seen["at_aim"] * seen["aims"])
        said = f"The target was in the picture at {inside} of the {seen['aims']} instants that the camera was aimed for"
    if seen["frames"] is not None:
        said += f", and in {percent(seen['frames'])} of the frames"
    if camera["shots"] and (none := camera["fixes"] - camera["shots"]):
        said += f". By {none:,} of the {camera['fixes']:,} fixes it was not aimed"
    if lost["times"]:
        times = "once" if lost["times"] == 1 else f"{lost['times']} times"
        said += f". Camera control lost the camera {times}, for {span(lost['s'])} in all"
    return f"{said}."


def lines(camera: Mapping[str, Any]) -> list[Line]:
    """The figures of metrics.json."""
    seen, gateway, orders = camera["in_frame"], camera["gateway"], camera["orders"]
    others = ", ".join(f"{n:,} {name}" for name, n in camera["outcomes"].items() if name != AIMED)
    made = f"{camera['shots']:,}" + (f"; no shot: {others}" if others else "")
    found: list[Line] = [
        ("fixes that came to camera control", f"{camera['fixes']:,}", False),
        ("shots", made, bool(camera["outcomes"].get("camera lost"))),
    ]
    if camera["replaced"]:
        found.append(("shots that the next one replaced before their aim", f"{camera['replaced']:,}", False))
    if seen["shots"] is not None:
        found.append(("shots with the target in any frame", percent(seen["shots"]), False))
    for id, one in camera["targets"].items():
        share = NOTHING if one["at_aim"] is None else f"{percent(one['at_aim'])} of {one['aims']:,} aims"
        found.append((f"{id}: shots; in the picture", f"{one['n']:,}; {share}", False))
    left = f"{gateway['passed']:,} handed on, {gateway['refused']:,} refused, {gateway['dropped']:,} dropped"
    left += f", {gateway['unwanted']:,} that nobody wanted; {gateway['queue_max']:,} waited at most"
    found.append(("gateway", left, bool(gateway["dropped"])))
    if any(orders.values()):
        said = ", ".join(f"{n:,} {answer}" for answer, n in orders.items() if n)
        found.append(("orders of system control", said, bool(orders["unknown"] or orders["silent"])))
    if camera["refused_orders"]:
        found.append(("orders that processes refused", f"{camera['refused_orders']:,}", True))
    return found


def spreads(camera: Mapping[str, Any]) -> Table:
    """How long shots took, and how far they were off."""
    rows = [
        [name, *(number(camera[key][which], unit).replace(" °", "°") for which in ("mean", "p95", "max"))]
        for key, (name, unit) in SPREADS.items()
        if camera[key]["mean"] is not None
    ]
    return Table(["of each shot", "mean", "95 %", "most"], rows)


# --- tables -----------------------------------------------------------------------------------------------------------


def shots(run: Run) -> Table:
    """A row for each fix that came to camera control, in the order of time."""
    found = judge(run)
    judged = {} if found is None else {shot.aim: shot for shot in found.shots}
    aims = run.outside.aims[:MOST_SHOTS] if run.outside else ()
    several = [*(["target"] if run.several else [])]
    head = ["fix came at", "shot", "from", "delay", "aimed for", *several, "off", "in pan", "in tilt", "in the picture"]
    return Table(head, [_row(run, aim, judged.get(aim)) for aim in aims])


def _row(run: Run, aim: Aim, shot: Shot | None) -> list[str]:
    came, at = ((t_ns - run.site.origin_ns) / NS for t_ns in (aim.t_ns, aim.aim_ns))
    row = [f"{came:.2f} s", str(aim.shot or NOTHING), f"{aim.head}, step {aim.step}", f"{aim.delay_s:.2f} s"]
    if shot is None:
        return [*row, *[NOTHING] * (5 if run.several else 4), f"no shot: {aim.outcome}"]
    target = [shot.target or NOTHING] if run.several else []
    off = [NOTHING] * 3
    if shot.error is not None:
        pan, tilt = (f"{round(one, 1) + 0.0:+.1f}°" for one in (shot.error.pan_deg, shot.error.tilt_deg))
        off = [number(shot.error.place_m, "m"), pan, tilt]
    seen = {True: "yes", False: f"no: {shot.why}", None: f"not known: {shot.why}"}[shot.in_frame]
    return [*row, f"{at:.2f} s", *target, *off, seen]


def ways(run: Run) -> Table:
    """How long what takes a fix to the camera was under way, from each process to the next."""
    rows = []
    frames = run.frames
    carriers = frames.where("kind", *CARRIERS)
    for source, to in _chain(run):
        chosen = carriers & frames.where("src", source) & frames.where("dst", to)
        took = frames.link_s[chosen]
        took = took[np.isfinite(took)]
        if chosen.any():
            half, most = (f"{1e3 * float(np.quantile(took, q)):.1f} ms" if len(took) else NOTHING for q in (0.5, 0.95))
            rows.append([f"{source} → {to}", f"{int(chosen.sum()):,}", f"{len(took):,}", half, most])
    return Table(["from, to", "frames", "arrived", "median", "95 %"], rows)


def _chain(run: Run) -> Sequence[tuple[str, str]]:
    """(from, to) on the way of a fix from the gateway to the camera, and of what is asked of the video."""
    of = {role: [place.id for place in run.places if place.role == role] for role in ROLES}
    links = [*of[GATEWAY], *of[FORWARDER], *of[CONTROL]]
    ends = [(one, to) for one in of[CONTROL] for to in (*of[CAMERA], *of[CAPTURES])]
    return [*pairwise(links), *ends]


ROLES: Final = (GATEWAY, FORWARDER, CONTROL, CAMERA, CAPTURES)
"""The roles of the processes on that way, in its order."""


def drawn(run: Run) -> Figure | None:
    """Where the camera was told to look, where it looked, and where the targets were."""
    found = judge(run)
    return None if found is None else pointing.figure(run, found)


FIGURES: Final[style.Figures] = {"pointing": drawn}
