"""Counts a run's frames with plain zenoh: ``python listener.py ENDPOINT RUN``, until a line comes on stdin."""

import json
import sys

import zenoh

endpoint, run = sys.argv[1:]
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([endpoint]))
with zenoh.open(config) as session:
    frames = session.declare_subscriber(f"{run}/data/**", zenoh.handlers.FifoChannel(1_000_000))
    print("listening", flush=True)
    sys.stdin.readline()
    print(sum(1 for _ in iter(frames.try_recv, None)), flush=True)
