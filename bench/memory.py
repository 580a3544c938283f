"""What a node's memory is made of, as a table in Markdown: python -m bench.memory

Each row is the mean proportional set size (PSS) of 121 processes that a run's ancestor forked, as nodes are.
"""

from __future__ import annotations

import os
import time
from typing import Any, Final

from zenoh.handlers import Callback

from trackfield.drivers.session import NODE_RUNTIME, client_settings, open_session, router_settings
from trackfield.wire import keys

NODES: Final = 121
SETTLED_S: Final = 3.0


def idle() -> None:
    """A child that does nothing."""
    time.sleep(1e6)


def session(settings: str, name: str) -> None:
    """A child with a node's Zenoh session, inbox and token, and nothing else."""
    os.putenv("ZENOH_RUNTIME", NODE_RUNTIME)
    opened = open_session(settings)
    held: list[Any] = [opened.declare_subscriber(keys.inbox("field", name), Callback(print, indirect=False))]
    held.append(opened.liveliness().declare_token(keys.live(name)))
    time.sleep(1e6)


def pss_mb(body: str) -> float:
    """Of a child that becomes ``module:attribute``."""
    import statistics
    import tempfile
    from pathlib import Path

    import psutil

    from launcher.processes.children import Children
    from launcher.processes.preload import REHEARSAL
    from launcher.processes.zygote import Child

    with tempfile.TemporaryDirectory() as folder:
        log, endpoint = str(Path(folder) / "log"), f"unixsock-stream/{folder}/router.sock"
        children = Children(NODES + 1, ["node.role", "bench.memory", REHEARSAL])
        try:
            children.fork(
                "router", Child("launcher.processes.bodies:router", "router", log), router_settings([endpoint])
            )
            names = [f"n{number:03}" for number in range(NODES)]
            settings = client_settings(endpoint, "memory")
            for name in names:
                children.fork(name, Child(body, name, log), *([settings, name] if body.endswith("session") else []))
            time.sleep(SETTLED_S)
            if dead := [name for name in names if not children.alive(name)]:
                raise RuntimeError(f"{len(dead)} children died: {Path(log).read_text()[-500:]}")
            return statistics.fmean(psutil.Process(children.pid(n)).memory_full_info().pss for n in names) / 1e6
        finally:
            children.close()


def main() -> None:
    """See the module's docstring."""
    from bench.scale import machine, measured

    print(f"A node's memory ({machine()}):\n")
    whole = measured("bench.processes", nodes=NODES, seconds=1.0)["processes"]["pss_mb_per_node"]
    rows = {"a child that does nothing": pss_mb("bench.memory:idle"), "with a session": pss_mb("bench.memory:session")}
    print("| a process | PSS MB | more than the one above |\n| --- | ---: | ---: |")
    above = 0.0
    for name, size in {**rows, "a node": whole}.items():
        print(f"| {name} | {size:.2f} | {size - above:.2f} |")
        above = size


if __name__ == "__main__":
    main()
