"""``replay``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from launcher.commands.arguments import Trackers


def replay(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="The folder of a finished run.")],
    tracker: Trackers = None,
    drop_late: Annotated[bool, typer.Option("--drop-late", help="Without the reports that came late.")] = False,
    out: Annotated[Path | None, typer.Option(help="The replay's own folder; new or empty.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print metrics.json, and nothing else, to stdout.")] = False,
) -> None:
    """Fuse the reports of a run again, by other trackers (or its own), into a folder of their own."""
    from launcher.show import conclude, note
    from launcher.study.replay import caveats
    from launcher.study.replay import replay as fuse

    outcome = fuse(run, tracker or (), drop_late=drop_late, out=out, command=sys.argv)
    if as_json:
        print(json.dumps(outcome.metrics, indent=2))
    for caveat in caveats(outcome.metrics):
        note(caveat)
    conclude(outcome)
    raise typer.Exit(outcome.exit_code)
