"""How long it takes until all processes of a run are ready, and the processor time of that.

python -m bench.ready [--nodes 1000] [--fusing 0]
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import psutil

from bench.processes import GROUPS, _family, _group, _used
from launcher.plan.prepare import load, planned
from launcher.processes.deployment import Deployment
from launcher.processes.garbage import look_seldom


def measure(nodes: int, fusing: int) -> dict[str, Any]:
    plan = planned(load("zhai-spcpf", nodes=nodes, seed=1))
    with tempfile.TemporaryDirectory() as folder:
        me = psutil.Process()
        own = time.process_time()
        begun = time.monotonic()
        with Deployment(plan, Path(folder)) as field:
            forked = time.monotonic()
            field.wait_ready(lambda missing, of: False)
            ready = time.monotonic()
            used = _used([(p, _group(p)) for p in _family(me.pid)])
            zyg = time.clock_gettime((~field._children.pid("zygote") << 3) | 2)
            used["zygote"] = zyg
            used["launcher"] = time.process_time() - own
    return {
        "processes": len(plan.processes),
        "forked_s": forked - begun,
        "ready_s": ready - begun,
        "cpu_s": used,
        "all": sum(used.values()),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--nodes", type=int, default=1000)
    parser.add_argument("--fusing", type=int, default=0)
    look_seldom()
    print(json.dumps(measure(**vars(parser.parse_args()))))


if __name__ == "__main__":
    main()
