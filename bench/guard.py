"""What it costs a router to see what it refuses: processor time for each message that it hands on, as a table.

    python -m bench.guard [--rate 2000] [--seconds 10] [--rounds 3]

One node sends frames to another, over TLS in the last two rows; the last router keeps its log, and reads it.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from typing import Any, Final

import psutil
import zenoh
from zenoh.handlers import Callback

from launcher.plan.prepare import load, planned
from launcher.records import ROUTER
from launcher.security.security import Wanted, made
from launcher.timeline.view import free_port
from trackfield.drivers.session import client_settings, open_session, router_settings

SENDER, RECEIVER = "n000", "fusion"
ROUTER_PROGRAM: Final = """
import sys
from launcher.security.guard import guarded
router = guarded(sys.stdin.readline())
print("ready", file=sys.stderr, flush=True)
sys.stdin.read()
"""
CASES: Final = {"tcp, no rules": (False, False), "TLS and rules": (True, False), "the same, guarded": (True, True)}


def measure(secured: bool, counted: bool, rate: int, seconds: float) -> dict[str, float]:
    """Processor time (us) of the router for each message, and the share of them that arrived."""
    plan = planned(load("zhai-spcpf", nodes=9))
    security, _ = made(plan, Wanted())
    endpoint = f"{'tls' if secured else 'tcp'}/127.0.0.1:{free_port()}"
    more: dict[str, Any] = dict(security.settings) if secured else {}
    if not counted:
        more.pop("metadata", None)
    credentials = security.credentials if secured else lambda _: None
    program = [sys.executable, "-c", ROUTER_PROGRAM]
    router = subprocess.Popen(program, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert router.stdin is not None
    assert router.stderr is not None
    try:
        router.stdin.write(router_settings([endpoint], credentials(ROUTER), more=more) + "\n")
        router.stdin.flush()
        assert router.stderr.readline() == "ready\n"
        sender, receiver = (
            open_session(client_settings(endpoint, plan.run.run, 60.0, credentials(name)))
            for name in (SENDER, RECEIVER)
        )
        return _sent(psutil.Process(router.pid), sender, receiver, rate, seconds)
    finally:
        router.kill()
        router.wait()


def _sent(
    router: psutil.Process, sender: zenoh.Session, receiver: zenoh.Session, rate: int, seconds: float
) -> dict[str, float]:
    came: list[zenoh.Sample] = []
    receiver.declare_subscriber(f"data/*/to/{RECEIVER}/**", Callback(came.append, indirect=False))
    time.sleep(1.0)
    before, begun, count = sum(router.cpu_times()[:2]), time.monotonic(), round(rate * seconds)
    for number in range(count):
        sender.put(f"data/field/to/{RECEIVER}/{SENDER}/doa", bytes(12), attachment=bytes(28))
        time.sleep(max(begun + number / rate - time.monotonic(), 0.0))
    time.sleep(1.0)
    cost_us = (sum(router.cpu_times()[:2]) - before) / count * 1e6
    sender.close()  # type: ignore[no-untyped-call]
    receiver.close()  # type: ignore[no-untyped-call]
    return {"us": cost_us, "arrived": len(came) / count}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rate", type=int, default=2000, help="messages a second")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rounds", type=int, default=3)
    asked = parser.parse_args()
    how = asked.rate, asked.seconds
    print(f"{how[0]} messages a second for {how[1]:g} s, from one node to another, the least of {asked.rounds}")
    rounds = [{name: measure(*case, *how) for name, case in CASES.items()} for _ in range(asked.rounds)]
    print("| router | processor time for a message (us) | arrived |")
    print("| --- | --- | --- |")
    for name in CASES:
        cost_us, arrived = (min(figures[name][what] for figures in rounds) for what in ("us", "arrived"))
        print(f"| {name} | {cost_us:.0f} | {arrived:.1%} |")


if __name__ == "__main__":
    main()
