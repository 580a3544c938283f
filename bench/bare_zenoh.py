"""Zenoh alone, through the same router as a run: the reference for Trackfield's own figures."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import Final

import zenoh
from zenoh.handlers import Callback

from trackfield.drivers.session import Credentials, open_client

KEY: Final = "data/bench"
PERIOD_S: Final = 0.25
"""Between two puts."""
PAYLOAD_BYTES: Final = 34
"""As long as a report with its envelope; the first 8 hold when it was put."""


def put_now_and_then(endpoint: str, namespace: str, phase: float, order: Connection) -> None:
    """Put the time repeatedly until ordered to end; processes with the same phase (0 to 1) put at the same instants."""
    session = open_client(endpoint, namespace)
    publisher = session.declare_publisher(KEY)
    while not order.poll(PERIOD_S - (time.monotonic() - phase * PERIOD_S) % PERIOD_S):
        publisher.put(time.monotonic_ns().to_bytes(8, "little").ljust(PAYLOAD_BYTES, b"\0"))
    session.close()  # type: ignore[no-untyped-call]


def hear_latencies(endpoint: str, namespace: str, order: Connection) -> None:
    """Answer an order with the ns that each put took."""
    took: list[int] = []

    def on_sample(sample: zenoh.Sample) -> None:
        arrived_ns = time.monotonic_ns()
        took.append(arrived_ns - int.from_bytes(sample.payload.to_bytes()[:8], "little"))

    session = open_client(endpoint, namespace)
    subscriber = session.declare_subscriber(KEY, Callback(on_sample, indirect=False))
    order.send(None)
    order.recv()
    subscriber.undeclare()  # type: ignore[no-untyped-call]
    order.send(took)
    session.close()  # type: ignore[no-untyped-call]


def count(endpoint: str, namespace: str, key: str, credentials: Credentials | None, order: Connection) -> None:
    """Answer each order with the number of samples so far; an empty one ends it."""
    counted = 0

    def on_sample(_: zenoh.Sample) -> None:
        nonlocal counted
        counted += 1

    session = open_client(endpoint, namespace, credentials=credentials)
    subscriber = session.declare_subscriber(key, Callback(on_sample, indirect=False))
    order.send(None)
    while order.recv():
        order.send(counted)
    subscriber.undeclare()  # type: ignore[no-untyped-call]
    session.close()  # type: ignore[no-untyped-call]


@contextmanager
def process(target: object, *arguments: object) -> Iterator[Connection]:
    """One of the above functions in its own process, and this end of its connection; killed at the end of the block."""
    context = multiprocessing.get_context("spawn")
    ours, its = context.Pipe()
    child = context.Process(target=target, args=(*arguments, its), daemon=True)  # type: ignore[arg-type]
    child.start()
    try:
        yield ours
    finally:
        child.kill()
        child.join()
