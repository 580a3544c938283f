"""System control, and processes beyond a gateway that take its orders, without I/O: frames go from hop to hop."""

from __future__ import annotations

from typing import Any, Final

from gateway.system import PORT, System
from launcher.plan.architectures.outside.chain import Chain
from tests.ether import DELAY_NS, Actor, Net
from tests.puppet import MS
from trackfield.protocols.carried import Carried
from trackfield.protocols.managed import Managed
from trackfield.role import NS, Effect, Event, PortRead, Received, SetTimer, Started, Store, Tell, Timer, Write

KEY: Final = "00112233445566778899aabbccddeeff"
SYSTEM: Final = "system"
CONTROL: Final = "camera-control"
VIDEO: Final = "video"
END: Final = (CONTROL, VIDEO, SYSTEM)
TICK_NS: Final = 100 * MS
PATIENCE_NS: Final = 10 * DELAY_NS


class Clockwork:
    """A role that counts ten times a second, and stores every tenth of its counts."""

    kinds = frozenset[str]()

    def begin(self) -> int:
        return -1

    def handle(self, state: int, event: Event) -> tuple[int, tuple[Effect, ...]]:
        match event:
            case Started(now, stored):
                return int(stored or b"0"), (SetTimer("tick", now + TICK_NS),)
            case Timer(now):
                kept = (Store(b"%d" % (state + 1)),) if (state + 1) % 10 == 0 else ()
                return state + 1, (SetTimer("tick", now + TICK_NS), *kept)
        raise AssertionError(f"{event} came")


class Outside(Net):
    """A base, so many hops, camera control, video and system control; all but the last are clockworks.

    ``told`` is what roles told, ``typed`` what system control wrote to whoever types there.
    """

    def __init__(self, *orders: tuple[float, str, str], hops: int = 0) -> None:
        super().__init__()
        self.chain = Chain(["base", *(f"hop{i}" for i in range(1, hops + 1))], END)
        self.told, self.written = list[tuple[int, str, Tell]](), ""
        self.reaches = lambda src, dst: dst in self.chain.near(src)
        self.managed = [*self.chain.links, CONTROL, VIDEO]
        for id in [*self.managed, SYSTEM]:
            self.add(id, self._carried(id, self._system(orders) if id == SYSTEM else self._managed(id)), (0.0, 0.0))
        for id in self.actors:
            self.start(id)

    def type(self, line: str) -> None:
        """Somebody types this."""
        self._give(SYSTEM, PortRead(self.t_ns, PORT, f"{line}\r".encode()))

    def answers(self) -> list[tuple[Any, ...]]:
        """What became of the orders: number, verb, process, answer."""
        return [one.values for _, id, one in self.told if id == SYSTEM and one.topic == "order"]

    def refused(self) -> list[tuple[str, Any, Any]]:
        """Who refused whose order, and why."""
        return [(id, *one.values) for _, id, one in self.told if one.topic == "refused order"]  # type: ignore[misc]

    def lines(self) -> list[str]:
        return self.written.splitlines()

    def count(self, id: str) -> int:
        """What a clockwork has counted; -1 while it is stopped."""
        state = self.state(id)
        while hasattr(state, "role"):
            state = state.role
        return int(state)

    def until(self, seconds: float) -> Outside:
        return self.run(round(seconds * NS))

    def _system(self, orders: tuple[tuple[float, str, str], ...]) -> System:
        planned = [(round(at_s * NS), verb, id) for at_s, verb, id in orders]
        return System(id=SYSTEM, key=KEY, managed=self.managed, patience_ns=PATIENCE_NS, orders=planned)

    def _managed(self, id: str) -> Managed:
        near = [*self.chain.near(id), *self.chain.next(id)]
        return Managed(Clockwork(), id=id, key=KEY, operator=SYSTEM, near=near)

    def _carried(self, id: str, role: Any) -> Any:
        return Carried(role, id=id, **carries) if (carries := self.chain.carries(id, 0)) else role

    def _give(self, id: str, event: Event) -> None:
        """All of it goes over the backbone."""
        if isinstance(event, Received):
            event = Received(event.now, event.message, event.sender, "backbone")
        super()._give(id, event)

    def _do(self, id: str, actor: Actor, effect: Effect) -> None:
        if isinstance(effect, Tell):
            self.told.append((self.t_ns, id, effect))
        elif isinstance(effect, Write):
            self.written += effect.data.decode()
        super()._do(id, actor, effect)
