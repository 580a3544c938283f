"""A role that starts alone, on this machine or another, and gets all that it must know from the launcher."""

from __future__ import annotations

import argparse
import logging
import os
import sys

import zenoh
from setproctitle import setproctitle

from trackfield.drivers.join import JoinError
from trackfield.drivers.process import Process
from trackfield.drivers.session import NODE_RUNTIME, open_client
from trackfield.wire.error import WireError
from trackfield.wire.keys import check_id


def main(role: str, description: str | None) -> None:
    """Join a run as one of its processes and live its life; exit 2 for bad arguments, 1 if it cannot join."""
    parser = argparse.ArgumentParser(
        prog=f"python -m {role}", description=(description or "").partition("``: ")[2].capitalize()
    )
    parser.add_argument("--connect", required=True, metavar="ENDPOINT", help="the run's router, like tcp/10.0.0.1:7447")
    parser.add_argument("--run", required=True, metavar="ID", help="the run's id (manifest.json, or its start-up line)")
    parser.add_argument("--id", required=True, help="which of the run's processes this is, like n060")
    arguments = parser.parse_args()
    try:
        check_id(arguments.id)
    except WireError as error:
        parser.error(str(error))
    logging.basicConfig(format="%(asctime)s %(levelname)s %(message)s")
    os.environ["ZENOH_RUNTIME"] = NODE_RUNTIME
    setproctitle(f"trackfield {role} {arguments.id}")
    try:
        Process(open_client(arguments.connect, arguments.run), arguments.id).run()
    except (JoinError, zenoh.ZError) as error:
        sys.exit(f"{role} {arguments.id}: cannot join the run {arguments.run} through {arguments.connect}: {error}")
