"""Messages per second that the recorder processes, beside a bare subscriber that only counts.

    python -m bench.recorder --messages 200000 --rate 20000

A recorder process as in a run, behind a router as in a run, hears DOA reports of 121 nodes, all put by one process.
First as fast as possible: nothing is dropped on the way, so the receiver sets the pace; the time until the last report
is in the ledger counts. Then at a fixed rate, as from nodes, when Zenoh may drop messages that are not taken.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import msgpack
import zenoh
from zenoh.handlers import Callback

from bench import bare_zenoh
from launcher.plan.prepare import load, planned
from launcher.processes.children import Children
from launcher.processes.zygote import Child
from launcher.records import RECORDER, SENSES, Plan
from trackfield.drivers.engine.frames import Frame
from trackfield.drivers.exchange.versions import Digest, digest
from trackfield.drivers.session import client_settings, open_client, router_settings
from trackfield.wire import keys
from trackfield.wire.codec import encode
from trackfield.wire.envelope import Envelope
from trackfield.wire.messages import Doa

TARGET: Final = 20_000
"""Messages a second."""
CHUNK: Final = 100
"""Reports that are put in one go, when they are put at a rate."""
PATIENCE_S: Final = 60.0
POLL_S: Final = 0.02
PROBE: Final = "data/probe"
SETTLE_S: Final = 0.5
"""Time for probes that are still on their way."""

Figures = dict[str, Any]


class Bench:
    """A router, and a session besides those that are measured, for one plan; a context manager."""

    def __init__(self, plan: Plan, folder: Path) -> None:
        self.plan, self.folder = plan, folder
        self.endpoint = f"unixsock-stream/{folder / 'router.sock'}"
        self._nodes = [place.id for place in plan.info.tagged(SENSES)]
        (self._centre,) = plan.views[0].sources
        self._sent_ns: list[int] = []

    def __enter__(self) -> Bench:
        self.children = Children(2)
        self.children.fork(
            "router",
            Child("launcher.processes.bodies:router", "router", str(self.folder / "router.log")),
            router_settings([self.endpoint]),
        )
        self.session = open_client(self.endpoint, self.plan.run.run)
        return self

    def __exit__(self, *_: object) -> None:
        self.children.close()
        self.session.close()  # type: ignore[no-untyped-call]

    def feed(self, messages: int, rate: float | None = None) -> float:
        """Put this many reports, at a rate (1/s) or as fast as they are received; returns the duration (s)."""
        control = zenoh.CongestionControl.BLOCK if rate is None else zenoh.CongestionControl.DROP
        to = [keys.unicast("field", self._centre, node, "doa") for node in self._nodes]
        payloads = [encode(Doa(1 + k, 0.7 * k, 60.0)) for k in range(500)]
        begun, begun_ns = time.monotonic(), time.monotonic_ns()
        self._sent_ns = []
        for k in range(messages):
            if rate is not None and k % CHUNK == 0:
                time.sleep(max(begun + k / rate - time.monotonic(), 0))
            self._sent_ns.append(time.monotonic_ns() - begun_ns)
            envelope = Envelope(self._sent_ns[-1], seq=k, version=0).pack()
            self.session.put(to[k % len(to)], payloads[k % 500], attachment=envelope, congestion_control=control)
        return time.monotonic() - begun

    def final(self) -> None:
        """Send the final records, as all processes of a run do: of the reports that were put last, all got by all."""
        frames = [
            (Frame(self._nodes[k % len(self._nodes)], 0, "doa", sent_ns, 0, self._centre, "field", b""), 0)
            for k, sent_ns in enumerate(self._sent_ns)
        ]
        for index, name in enumerate(self._nodes):
            self._final(name, digest(frames[index :: len(self._nodes)]), Digest())
        self._final(self._centre, Digest(), digest(frames))

    def _final(self, name: str, sent: Digest, heard: Digest) -> None:
        record = {
            "incarnation": 0, "stored": b"", "activity": {"field": [0] * 5}, "inherited": {}, "metered_ns": 0,
            "sent": sent.size, "sent_hash": sent.total, "heard": heard.size, "heard_hash": heard.total,
            "puts": sent.size, "retractions": 0, "told": 0, "slip": {}, "lag": {}, "latency": {}, "cpu_s": 0.0,
        }  # fmt: skip
        blocking = zenoh.CongestionControl.BLOCK
        self.session.put(keys.telemetry(name, "final"), msgpack.packb(record), congestion_control=blocking)


def counted(bench: Bench, messages: int) -> float:
    """Messages a second that a bare subscriber counts."""
    with bare_zenoh.process(bare_zenoh.count, bench.endpoint, bench.plan.run.run, keys.ALL_DATA, None) as counter:
        counter.recv()

        def heard() -> int:
            counter.send(True)
            return int(counter.recv())

        while not heard():  # until the router knows the subscriber
            bench.session.put(PROBE, b"")
            time.sleep(POLL_S)
        time.sleep(SETTLE_S)
        probes, begun = heard(), time.monotonic()
        bench.feed(messages)
        _until(lambda: heard() >= probes + messages)
        return messages / (time.monotonic() - begun)


def recorded(bench: Bench, messages: int, rate: float | None = None) -> Figures:
    """A recorder's figures: messages a second until all were in the ledger, how long after the last put that was (s),
    its processor time per message, and how many were dropped, by its own count."""
    folder = bench.folder / f"run-{rate}"
    folder.mkdir()
    heard: list[int] = [0]

    def on_status(sample: zenoh.Sample) -> None:
        heard.append(msgpack.unpackb(sample.payload.to_bytes())["sent"])

    key = keys.telemetry(RECORDER, "status")
    told = bench.session.declare_subscriber(key, Callback(on_status, indirect=False))
    recorder = Child("launcher.record.recorder:record", RECORDER, str(folder / "log"), graceful=True)
    bench.children.fork(
        RECORDER, recorder, client_settings(bench.endpoint, bench.plan.run.run), bench.plan, folder, b""
    )  # without seals
    _until(lambda: len(heard) > 1 or not bench.children.alive(RECORDER))
    if len(heard) == 1:
        raise RuntimeError(f"the recorder died: {(folder / 'log').read_text()}")
    bench.session.put(keys.START, str(time.monotonic_ns()))
    begun, cpu_s = time.monotonic(), bench.children.cpu_s(RECORDER)
    took_s = bench.feed(messages, rate)
    # At a rate some may never arrive; then the count stops growing.
    _until(lambda: heard[-1] >= messages or (rate is not None and len(heard) > 12 and len(set(heard[-12:])) == 1))
    all_s, cpu_s = time.monotonic() - begun, bench.children.cpu_s(RECORDER) - cpu_s
    bench.final()
    bench.session.put(keys.FINISH, msgpack.packb([]))
    bench.children.wait([RECORDER], PATIENCE_S)
    told.undeclare()  # type: ignore[no-untyped-call]
    metrics = json.loads((folder / "metrics.json").read_text())
    return {
        "per_s": messages / all_s,
        "behind_s": all_s - took_s,
        "cpu_us": cpu_s / messages * 1e6,
        "dropped": metrics["recorder"]["dropped"],
    }


def measure(messages: int = 200_000, rate: float = TARGET, seed: int = 1) -> Figures:
    """All figures: a bare subscriber and a recorder at full speed, a recorder at the rate."""
    settings = [f"target.steps={max(round(messages / rate), 60)}"]
    with tempfile.TemporaryDirectory(prefix="trackfield-") as scratch:
        plan = planned(load("zhai-spcpf", seed=seed, link="ideal", settings=settings))
        with Bench(plan, Path(scratch)) as bench:
            plain = [counted(bench, messages)]
            fast = recorded(bench, messages)
            plain.append(counted(bench, messages))
            steady = recorded(bench, messages, rate)
    per_s = sum(plain) / len(plain)
    return {"bare_per_s": per_s, "fast": fast, "steady": steady, "ratio": fast["per_s"] / per_s, "rate": rate}


def table(found: Figures) -> str:
    """In Markdown."""
    fast, steady = found["fast"], found["steady"]
    rows = [("bare subscriber that counts, as fast as it can", f"{found['bare_per_s']:,.0f}", "", "", 0)]
    for name, f in (("as fast as it can", fast), (f"{found['rate']:,.0f} a second", steady)):
        rows.append(
            (f"recorder, {name}", f"{f['per_s']:,.0f}", f"{f['cpu_us']:.1f}", f"{f['behind_s']:.1f}", f["dropped"])
        )
    lines = ["| | messages a second | CPU us a message | last one in after s | dropped |", "| --- |" + " ---: |" * 4]
    lines += [f"| {' | '.join(map(str, row))} |" for row in rows]
    end = f"The recorder takes {found['ratio']:.2f} of what a bare subscriber takes (target: {TARGET:,} a second)"
    return "\n".join([*lines, "", end])


def _until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError(f"not within {PATIENCE_S:.0f} s")
        time.sleep(POLL_S)


def main() -> None:
    """See the module's docstring."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=200_000)
    parser.add_argument("--rate", type=float, default=TARGET)
    parser.add_argument("--seed", type=int, default=1)
    print(table(measure(**vars(parser.parse_args()))))


if __name__ == "__main__":
    main()
