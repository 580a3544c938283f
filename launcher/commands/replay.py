"""``replay``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from launcher.commands.arguments import Run, Trackers


def replay(
    run: Run,
    tracker: Trackers = None,
    drop_late: Annotated[
        bool, typer.Option("--drop-late", help="Leave out the reports that came after their deadline.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="The folder of the replay; new or empty.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print metrics.json, and nothing else, to stdout.")] = False,
) -> None:
    """Fuse the recorded reports of a run again, with other trackers or its own, into a new run folder."""
    from launcher.show import conclude, note
    from launcher.study.replay import caveats
    from launcher.study.replay import replay as fuse

    outcome = fuse(run, tracker or (), drop_late=drop_late, out=out, command=sys.argv)
    if as_json:
        print(json.dumps(outcome.metrics, indent=2))
    for caveat in caveats(outcome.metrics, drop_late=drop_late):
        note(caveat)
    conclude(outcome)
    raise typer.Exit(outcome.exit_code)
