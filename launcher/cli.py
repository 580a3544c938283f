"""The command line, ``trackfield``."""

from __future__ import annotations

import atexit
import signal
import sys
from errno import EPIPE
from functools import partial
from typing import Annotated, NoReturn

import typer

from launcher import INTERRUPTED
from launcher.commands import (
    calibrate,
    choices,
    compare,
    control,
    elsewhere,
    listen,
    listing,
    new,
    recover,
    replay,
    reproduce,
    run,
    study,
    validate,
    view,
)
from launcher.files import check_text
from launcher.processes.garbage import look_seldom
from launcher.signals import ENDING, Interrupted, handling
from trackfield.errors import ScenarioError, TrackfieldError
from trackfield.streams import steady, unheard

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
command("control")(control.control)
command("replay")(replay.replay)
command("recover")(recover.recover)
command("study")(study.study)
command("listen")(listen.listen)
command("reproduce")(reproduce.reproduce)
command("router")(elsewhere.router)
command("certificates")(elsewhere.certificates)
command("field")(elsewhere.field)
app.add_typer(calibrate.group)


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
    steady()
    look_seldom()
    atexit.register(_ending)
    came: list[int] = []

    def interrupt(number: int) -> None:
        came.append(number)
        raise Interrupted

    with handling(interrupt, (signal.SIGTERM, signal.SIGHUP)):
        code = _called()
    if came and code in (0, INTERRUPTED):
        code = 128 + came[0]
    raise SystemExit(code or _lost())


def _ending() -> None:
    """The program ends already, with the exit code that it has: no signal changes that."""
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)


def _called() -> int:
    """Do what the command line says; the exit code."""
    try:
        check_text(sys.argv[1:])
        return app(prog_name="trackfield", standalone_mode=False) or 0
    except typer.TyperException as error:  # an unknown or incomplete command or option
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "trackfield"
        if message := error.format_message().rstrip("."):
            return _told(f"{message}; see {command} --help", 2)
        return 2  # nothing was asked for, and typer has shown the help
    except TrackfieldError as error:
        return _told(str(error), 2 if isinstance(error, ScenarioError) else 1)
    except (OSError, MemoryError, UnicodeEncodeError) as error:  # the disk, the machine's limits, a folder's name
        where, what = getattr(error, "filename", None), getattr(error, "strerror", None)
        return _told(f"{where or 'the machine'}: {what or error or 'out of memory'}", 1)
    except KeyboardInterrupt:
        return INTERRUPTED


def _told(message: str, code: int) -> int:
    print(f"trackfield: {message}", file=sys.stderr)
    return code


def _lost() -> int:
    """The exit code of a command that did all it should, but may have printed it for nobody."""
    lost = unheard()
    if lost is None:
        return 0
    if lost.errno == EPIPE:  # whoever read it has seen enough
        return 128 + signal.SIGPIPE
    return _told(f"what should go to stdout was lost ({lost.strerror})", 1)


if __name__ == "__main__":
    main()
