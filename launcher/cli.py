"""The command line, ``trackfield``."""

from __future__ import annotations

import sys
from functools import partial
from typing import Annotated, NoReturn

import typer

from launcher import INTERRUPTED
from launcher.commands import (
    choices,
    compare,
    listing,
    new,
    recover,
    replay,
    reproduce,
    router,
    run,
    study,
    validate,
    view,
)
from launcher.processes.garbage import look_seldom
from trackfield.errors import ScenarioError, TrackfieldError

app = typer.Typer(
    name="trackfield",
    cls=choices.Commands,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
command = partial(app.command, cls=choices.Choosing)
command("run")(run.run)
command("new")(new.new)
command("validate")(validate.validate)
command("list")(listing.list_kinds)
command("view")(view.view)
command("report")(view.report)
command("compare")(compare.compare)
command("replay")(replay.replay)
command("recover")(recover.recover)
command("study")(study.study)
command("reproduce")(reproduce.reproduce)
command("router")(router.router)


def _say_version(asked: bool) -> None:
    if asked:
        from importlib.metadata import version

        print(f"trackfield {version('trackfield')}")
        raise typer.Exit


@app.callback()
def program(
    version: Annotated[
        bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Emulates field deployments that track moving targets with networks of small sensors."""


def main() -> NoReturn:
    """The program: exit 2 with one message for bad input, 1 for a failed run, never a traceback for either."""
    look_seldom()
    try:
        raise SystemExit(app(prog_name="trackfield", standalone_mode=False))
    except typer.TyperException as error:  # an unknown or incomplete command or option
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "trackfield"
        if message := error.format_message().rstrip("."):
            _end(f"{message}; see {command} --help", 2)
        raise SystemExit(2) from None  # nothing was asked for, and typer has shown the help
    except ScenarioError as error:
        _end(str(error), 2)
    except TrackfieldError as error:
        _end(str(error), 1)
    except KeyboardInterrupt:
        raise SystemExit(INTERRUPTED) from None


def _end(message: str, code: int) -> NoReturn:
    print(f"trackfield: {message}", file=sys.stderr)
    raise SystemExit(code)


if __name__ == "__main__":
    main()
