"""What the links and the routers of a field on several hosts cost, as a table in Markdown.

    python -m bench.links [--messages 100000]

Reports go from one process to another through the router of a run, or through that of a slice and that of the run, over
TCP, or with certificates: as fast as they are taken, and then one by one. A relay before the run's router counts bytes.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Final

import zenoh

from bench import bare_zenoh
from bench.processes import clock
from bench.relay import Relay, free_port
from bench.scale import Column, Figures, machine, table
from launcher.processes.children import Children
from launcher.processes.zygote import Child
from launcher.security.authority import DAY_S, Authority
from trackfield.drivers.session import Credentials, open_client, router_settings
from trackfield.wire import keys
from trackfield.wire.codec import encode
from trackfield.wire.envelope import Envelope
from trackfield.wire.messages import Doa

RUN: Final = "bench"
CASES: Final = (("tcp", 1), ("tcp", 2), ("tls", 1), ("tls", 2))
"""The protocol to the run's router, and how many routers a report passes."""
TO: Final = "run", "slice"
"""The routers, as a report goes: the first is the run's, behind a slice's if there is one."""
SINGLE: Final = 400
"""Reports that are put one by one."""
PAUSE_S: Final = 0.01
"""Between them."""
IDLE_S: Final = 30.0
"""For so long a link is watched on which nothing is sent."""
PATIENCE_S: Final = 120.0
_REPORT: Final = encode(Doa(1, 0.7, 60.0))
_KEY: Final = keys.unicast("field", "fusion", "n0000", "doa")


class Line:
    """The routers of one case, a session at the near end, and the relay; counts what comes out at the far end."""

    def __init__(self, children: Children, session: zenoh.Session, relay: Relay, counter: Connection) -> None:
        self.children, self.session, self.relay, self._counter = children, session, relay, counter

    def cpu_s(self, router: str) -> float:
        """Its processor time so far."""
        return time.clock_gettime(clock(self.children.pid(router) or 0))

    def arrived(self) -> int:
        """How many reports so far."""
        self._counter.send(True)
        return int(self._counter.recv())

    def put(self, number: int) -> None:
        """One report, which waits for its place."""
        envelope = Envelope(1_000_000_000 + number, seq=number, version=0).pack()
        self.session.put(_KEY, _REPORT, attachment=envelope, congestion_control=zenoh.CongestionControl.BLOCK)

    def until(self, count: int) -> None:
        """Wait until so many have arrived. Raises ``TimeoutError``."""
        deadline = time.monotonic() + PATIENCE_S
        while self.arrived() < count:
            if time.monotonic() > deadline:
                raise TimeoutError(f"not {count} reports in {PATIENCE_S:g} s")
            time.sleep(0.005)


@contextmanager
def line(folder: Path, protocol: str, hops: int) -> Iterator[Line]:
    """A case. The far end hears at the run's router itself."""
    shown: dict[str, Credentials | None] = {"router": None, "near": None, "far": None}
    if protocol == "tls":
        authority = Authority(RUN, DAY_S)
        shown = {name: authority.issue(name) for name in shown}
    children, port = Children(hops), free_port()
    relay = Relay(port)
    near = between = f"{protocol}/127.0.0.1:{relay.port}"
    try:
        _fork(children, folder, TO[0], router_settings([f"{protocol}/127.0.0.1:{port}"], shown["router"]))
        if hops > 1:
            near = f"unixsock-stream/{folder / 'slice.sock'}"
            _fork(children, folder, TO[1], router_settings([near], shown["near"], upstream=between))
        session = open_client(near, RUN, credentials=shown["near"])
        far = f"{protocol}/127.0.0.1:{port}"
        with bare_zenoh.process(bare_zenoh.count, far, RUN, keys.ALL_DATA, shown["far"]) as counter:
            counter.recv()
            yield Line(children, session, relay, counter)
        session.close()  # type: ignore[no-untyped-call]
    finally:
        children.close()
        relay.close()


def _fork(children: Children, folder: Path, name: str, settings: str) -> None:
    children.fork(name, Child("launcher.processes.bodies:router", name, str(folder / f"{name}.log")), settings)


def measure(protocol: str, hops: int, messages: int) -> Figures:
    """The figures of one case."""
    names = TO[:hops]
    with tempfile.TemporaryDirectory(prefix="trackfield-") as folder, line(Path(folder), protocol, hops) as one:
        while not one.arrived():  # until the routers know where reports go
            one.put(0)
            time.sleep(0.1)
        time.sleep(1.0)
        before = one.arrived()
        cpu, begun = {name: one.cpu_s(name) for name in names}, time.monotonic()
        for number in range(messages):
            one.put(number)
        one.until(before + messages)
        took_s = time.monotonic() - begun
        cpu_us = {name: (one.cpu_s(name) - cpu[name]) / messages * 1e6 for name in names}
        sent = one.relay.up
        for number in range(SINGLE):
            one.put(number)
            time.sleep(PAUSE_S)
        one.until(before + messages + SINGLE)
        single = (one.relay.up - sent) / SINGLE
        passed = one.relay.bytes
        time.sleep(IDLE_S)
        idle = (one.relay.bytes - passed) / IDLE_S
    return {"case": f"{protocol}, {hops}", "per_s": messages / took_s, "cpu_us": cpu_us, "single": single, "idle": idle}


def _cpu(name: str) -> Callable[[Figures], object]:
    return lambda f: f"{f['cpu_us'][name]:.1f}" if name in f["cpu_us"] else ""


COLUMNS: Final[Sequence[Column]] = (
    ("protocol, routers", lambda f: f["case"]),
    ("reports a second", lambda f: f"{f['per_s']:,.0f}"),
    ("CPU us a report, the run's router", _cpu(TO[0])),
    ("a slice's router", _cpu(TO[1])),
    ("bytes of a report alone", lambda f: f"{f['single']:.0f}"),
    ("bytes a second, idle", lambda f: f"{f['idle']:.1f}"),
)


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=100_000)
    messages = parser.parse_args().messages
    found = [measure(protocol, hops, messages) for protocol, hops in CASES]
    print(f"Reports from one process to another ({machine()}):\n\n{table(COLUMNS, found)}")


if __name__ == "__main__":
    main()
