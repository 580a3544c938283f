"""``control``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Final

import typer

from launcher.commands import choices
from trackfield.errors import RunFailed, ScenarioError

TIMEOUT_S: Final = 30.0
"""A process that does not answer is given up by system control within a few seconds of emulated time."""


def _run_folder(text: str) -> Path:
    """What ``RUN`` means: a folder, or the latest run that goes on."""
    from launcher.record.latest import LATEST, RUNS, going_on

    if text != LATEST:
        return Path(text)
    if not (folders := going_on()):
        raise ScenarioError(f"no run goes on below {RUNS}/", key=text, expected="one, or the folder of a run")
    return folders[0]


def control(
    run: Annotated[
        Path,
        typer.Argument(
            metavar="RUN",
            parser=_run_folder,
            autocompletion=choices.completed(choices.going_on),
            help="The folder of a run that goes on; latest: the newest such below runs/.",
        ),
    ],
    order: Annotated[
        str,
        typer.Argument(metavar="ORDER", autocompletion=choices.completed(choices.orders), help="What to do: {orders}."),
    ],
    id: Annotated[
        str | None,
        typer.Argument(metavar="ID", help="Of which process; without one, the status of each."),
    ] = None,
    timeout: Annotated[
        float, typer.Option(metavar="SECONDS", min=0.1, max=3600, help="How long to wait for the answer.")
    ] = TIMEOUT_S,
) -> None:
    """Have system control start or stop a process of a run that goes on, or say how it is.

    The run needs a camera, and is one over processes at speed 1.
    """
    line = _checked(order, id)
    _check_run(run)
    refused = False
    for answer in _answers(run, line, id, timeout):
        refused |= not _print(answer)
    raise typer.Exit(int(refused))


def _checked(order: str, id: str | None) -> str:
    """The line for system control. Raises ``ScenarioError`` for what is no order."""
    from trackfield.scenario.nearest import suggestion
    from trackfield.wire.error import WireError
    from trackfield.wire.keys import check_id
    from trackfield.wire.outside import STATUS, VERBS
    from trackfield.words import quoted

    if order not in VERBS:
        what = f"unknown order {quoted(order)}{suggestion(order, VERBS)}"
        raise ScenarioError(what, key="ORDER", expected=f"one of {', '.join(VERBS)}")
    if id is None:
        if order != VERBS[STATUS]:
            raise ScenarioError(f"{order} is for one process", key="ID", expected="the id of a process")
        return order
    try:
        return f"{order} {check_id(id)}"
    except WireError:
        raise ScenarioError(f"there is no process {quoted(id)}", key="ID", expected="the id of a process") from None


def _check_run(run: Path) -> None:
    """Raise ``ScenarioError`` unless orders can be given in this run, now or soon."""
    from launcher.files import MANIFEST
    from launcher.record.journal import METRICS
    from launcher.record.latest import goes_on
    from launcher.record.reading.files import read_manifest, read_settings

    expected = "a run over processes that goes on"
    if not run.is_dir():
        raise ScenarioError("is no folder of a run", file=str(run), expected=expected)
    going = goes_on(run)
    if (run / MANIFEST).exists():
        manifest = read_manifest(run)
        if manifest.endpoint is None:
            raise ScenarioError("runs in virtual time, as fast as the machine can", file=str(run), expected=expected)
        if manifest.speed != 1:
            what = f"runs at speed {manifest.speed:g}, and people go by the wall clock"
            raise ScenarioError(what, file=str(run), expected="a run at speed 1")
        if read_settings(run).get("camera", {}).get("kind", "none") == "none":
            what = "has no system control"
            raise ScenarioError(what, file=str(run), key="camera.kind", expected="a run with a camera")
    elif not going:
        raise ScenarioError(f"has no {MANIFEST}: it is no run", file=str(run), expected=expected)
    if (run / METRICS).exists() or not going:
        raise ScenarioError("is over", file=str(run), expected=expected)


def _answers(run: Path, line: str, id: str | None, timeout_s: float) -> Iterator[str]:
    """What system control says, a line for each process. Raises ``ScenarioError`` for a process that it knows not."""
    from launcher.outside import SYSTEM
    from launcher.plan.bridges import link_of
    from launcher.processes.terminal import at_terminal
    from trackfield.scenario.nearest import suggestion

    with at_terminal(link_of(run, SYSTEM), timeout_s, lambda: _check_run(run)) as terminal:
        for answer in terminal.ask(line):
            if id is None and answer == "end":
                return
            if answer.startswith("unknown process ") and id is not None:
                known = answer.partition("processes: ")[2]
                what = f"there is no process {id}{suggestion(id, known.split(', '))}"
                raise ScenarioError(what, key="ID", expected=f"one of {known}")
            yield answer
            if id is not None or answer.startswith("refused:"):
                return


def _print(answer: str) -> bool:
    """Print the answer of a process, and whether it is as it should be."""
    id, _, state = answer.partition(" ")
    if answer.startswith(("refused", "not understood")):
        raise RunFailed(answer)
    print(f"{id:<20}{state}", flush=True)
    return state in ("running", "stopped")
