"""The processes beyond the gateway of a field (Yang et al., section 4), and what the base needs to be that gateway."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import blake2b
from math import atan2, degrees, dist
from typing import Any, Final

from launcher.outside import CAMERA, CONTROL, FORWARDER, GATEWAY, SYSTEM, VIDEO
from launcher.plan.architectures.arranged import Hosted, Process
from launcher.plan.architectures.field import Field
from launcher.plan.architectures.outside.chain import Chain
from launcher.plan.hardware import HOP_PATIENCE_NS, slowest_on
from launcher.plan.links import BAUD, section_of
from trackfield.drivers.ports import Port
from trackfield.errors import ScenarioError
from trackfield.role import NS
from trackfield.scenario.nearest import suggestion
from trackfield.scenario.sections.camera import EviD30
from trackfield.wire.keys import Medium
from trackfield.wire.passes import FIXES
from trackfield.words import quoted

HOP: Final = "hop"
OPERATOR: Final = "operator"
"""The port of system control."""
END: Final = (CONTROL, VIDEO, SYSTEM)
BACKBONE: Final[Medium] = "backbone"
SERIAL: Final[Medium] = "serial"
SLOW: Final = 4
"""A message may take so many times as long as on an idle link until it is sent again."""
LASTS_S: Final = 60.0
"""Camera control wants fixes for so long, and says so anew every third of that."""
KEY_BYTES: Final = 16


def outside_of(field: Field, base: str) -> Outside | None:
    """What is beyond the gateway of a field; None if there is none.

    Raises ``ScenarioError`` for ids that are taken, and for what the section says of unknown ones.
    """
    section = field.scenario.camera
    if not isinstance(section, EviD30):
        return None
    outside = Outside(field, base, section)
    _check(outside)
    return outside


@dataclass(frozen=True)
class Outside:
    """What the ``camera`` section asks for; the process ``base`` is the gateway."""

    field: Field
    base: str
    of: EviD30

    @cached_property
    def chain(self) -> Chain:
        """The backbone."""
        return Chain([self.base, *(f"{HOP}{i}" for i in range(1, len(self.of.hops) + 1))], END)

    @property
    def managed(self) -> list[str]:
        """The processes that take orders of system control."""
        return [*self.chain.links, CONTROL, VIDEO]

    @property
    def processes(self) -> list[Process]:
        """All but the gateway."""
        return [*self._hops(), self._control(), self._camera(), self._video(), self._system()]

    def gateway(self, base: Process, role: str) -> Process:
        """The process of the base as the gateway, with its own ``role`` as one of two."""
        hosted = {
            role: Hosted(config={**base.config, "gateway": True}, fuses=bool(base.fuses)),
            GATEWAY: Hosted(config=self._rules()),
        }
        both = replace(base, role=GATEWAY, roles=hosted, config={}, media=("field", BACKBONE))
        return self._connected(both, item=(CONTROL,), **{"order-reply": (SYSTEM,)})

    # --- what they are told ----------------------------------------------------------------------------------------

    def _rules(self) -> dict[str, Any]:
        """The arguments of the gateway."""
        site = self.field.site
        return {
            **{"id": self.base, "origin_ns": site.origin_ns, "step_ns": site.step_ns},
            **{"places": {id: [x, y] for id, x, y in self.field.sensors}, "queue": self.of.queue},
            **{"passes": list(self.of.passes), "heads": list(self.of.heads or ()), "patience_ns": self._patience_ns},
            "subscribers": [CONTROL],
        }

    @property
    def _patience_ns(self) -> int:
        """How long a message over the whole backbone and its answer may take."""
        one_ns = SLOW * slowest_on(section_of(self.field.scenario, BACKBONE), repeats=1) + HOP_PATIENCE_NS
        return 2 * len(self.chain.links) * (one_ns + round(self.of.hop_s * NS))

    @cached_property
    def _key(self) -> str:
        """The key of the run, in hexadecimal digits."""
        return blake2b(str(self.field.scenario.seed).encode(), digest_size=KEY_BYTES, person=b"orders").hexdigest()

    def _connected(self, process: Process, **sends: Sequence[str]) -> Process:
        """A process on the backbone, which sends this there besides what it hands on."""
        id, ways = process.id, self.chain
        own = {kind: tuple(to for to in ids if to in ways.near(id)) for kind, ids in sends.items()}
        on_backbone = {kind: ids for kind, ids in {**own, **ways.sends(id)}.items() if ids}
        managed = {} if id == SYSTEM else {"key": self._key, "operator": SYSTEM}
        return replace(
            process,
            sends={**process.sends, **on_backbone},
            over={**process.over, **dict.fromkeys(on_backbone, BACKBONE)},
            carries=ways.carries(id, round(self.of.hop_s * NS)),
            managed=managed,
        )

    # --- the processes ---------------------------------------------------------------------------------------------

    def _hops(self) -> list[Process]:
        return [
            self._connected(
                Process(id, FORWARDER, x, y, media=(BACKBONE,), asks=self.chain.before(id), asks_over=BACKBONE),
                **{"order-reply": (SYSTEM,)},
            )
            for id, (x, y) in zip(self.chain.links[1:], self.of.hops, strict=True)
        ]

    def _control(self) -> Process:
        site, of = self.field.site, self.of
        x, y = self._middle
        radius_m = max(dist((x, y), place) for _, *place in self.field.sensors) + 1.0
        config = {
            **{"id": CONTROL, "gateway": self.base, "camera": CAMERA, "video": VIDEO, "mount": self._mount},
            **{"origin_ns": site.origin_ns, "step_ns": site.step_ns, "tracker": self.field.scenario.fusion.trackers[0]},
            **{"predict": of.predict, "shot_s": of.shot_s, "patience_ns": self._patience_ns},
            "baud": getattr(section_of(self.field.scenario, SERIAL), "baud", BAUD),
            "wanted": {"task": FIXES, "x_m": x, "y_m": y, "radius_m": radius_m, "lasts_s": LASTS_S},
        }
        process = Process(
            CONTROL,
            CONTROL,
            of.x_m,
            of.y_m,
            config=config,
            sends={"visca": (CAMERA,)},
            over={"visca": SERIAL},
            media=(BACKBONE, SERIAL),
            asks=self.chain.before(CONTROL),
            asks_over=BACKBONE,
        )
        to_gateway = (self.base,)
        replies = {"item-ack": to_gateway, "order-reply": (SYSTEM,)}
        return self._connected(process, subscribe=to_gateway, capture=(VIDEO,), **replies)

    def _camera(self) -> Process:
        config = {"id": CAMERA, "peer": CONTROL}
        sends: Mapping[str, Sequence[str]] = {"visca": (CONTROL,)}
        of = self.of
        return Process(
            CAMERA, CAMERA, of.x_m, of.y_m, config=config, sends=sends, over={"visca": SERIAL}, media=(SERIAL,)
        )

    def _video(self) -> Process:
        config = {"id": VIDEO, "control": CONTROL, "frame_ns": round(NS / self.of.frames_s)}
        process = Process(VIDEO, VIDEO, self.of.x_m, self.of.y_m, config=config, media=(BACKBONE,))
        return self._connected(process, captured=(CONTROL,), **{"order-reply": (SYSTEM,)})

    def _system(self) -> Process:
        of, managed = self.of, self.managed
        config = {
            **{"id": SYSTEM, "key": self._key, "managed": managed, "patience_ns": self._patience_ns},
            "orders": [[self.field.site.origin_ns + round(at_s * NS), verb, id] for at_s, verb, id in of.orders],
        }
        ports = {OPERATOR: Port(terminal=True)}
        process = Process(SYSTEM, SYSTEM, of.x_m, of.y_m, config=config, ports=ports, media=(BACKBONE,))
        return self._connected(process, order=managed)

    @property
    def _middle(self) -> tuple[float, float]:
        xs, ys = zip(*((x, y) for _, x, y in self.field.sensors), strict=True)
        return sum(xs) / len(xs), sum(ys) / len(ys)

    @property
    def _mount(self) -> dict[str, float]:
        """Where the camera stands, and looks at pan 0."""
        of, (x, y) = self.of, self._middle
        heading_deg = degrees(atan2(y - of.y_m, x - of.x_m)) if of.heading_deg is None else of.heading_deg
        return {"x_m": of.x_m, "y_m": of.y_m, "z_m": of.z_m, "heading_deg": heading_deg}


# --- what cannot be ---------------------------------------------------------------------------------------------------


def _check(outside: Outside) -> None:
    sensors, of = [id for id, *_ in outside.field.sensors], outside.of
    own = [*outside.chain.links[1:], CONTROL, CAMERA, VIDEO, SYSTEM]
    if outside.base in own:
        what = f"is {quoted(outside.base)}, the id of a process beyond the gateway"
        raise ScenarioError(what, key="architecture.base", expected=f"another id than {', '.join(own)}")
    if taken := [id for id in sensors if id in own]:
        what = f"a sensor has the id {quoted(taken[0])}, and so has a process beyond the gateway"
        raise ScenarioError(what, key="field", expected=f"another id than {', '.join(own)}, or camera.kind = 'none'")
    for id in of.heads or ():
        if id not in sensors:
            what = f"there is no sensor {quoted(id)}{suggestion(id, sensors)}"
            raise ScenarioError(what, key="camera.heads", expected="ids of sensors, or unset")
    site = outside.field.site
    end_s = (site.end_ns - site.origin_ns) / NS
    for number, (at_s, _, id) in enumerate(of.orders):
        if id not in outside.managed:
            what = f"there is no process {quoted(id)} that takes orders{suggestion(id, outside.managed)}"
            expected = f"one of {', '.join(outside.managed)}"
            raise ScenarioError(what, key=f"camera.orders[{number}]", expected=expected)
        if at_s >= end_s:
            what = f"is at {at_s:g} s, and the run ends at {end_s:g} s"
            raise ScenarioError(what, key=f"camera.orders[{number}]", expected="a time before the end")
