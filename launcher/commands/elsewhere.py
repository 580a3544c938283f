"""``certificates``, ``router`` and ``field``: for runs whose processes start elsewhere."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from launcher.commands.arguments import CertificateAuthority, Speed
from launcher.commands.request import Changed, command


@dataclass(frozen=True, kw_only=True)
class Certified(Changed):
    """A changed scenario, and what the certificates for a run of it are to be like."""

    out: Annotated[Path, typer.Option(metavar="DIR", help="The folder of the certificates; new or empty.")]
    seed: Annotated[int | None, typer.Option(help="The seed of the run; unset: the scenario's own.")] = None
    speed: Speed = None
    ca: CertificateAuthority = None
    days: Annotated[
        float | None,
        typer.Option(help="How long they are valid; unset: a day, or twice as long as the run takes, if that is more."),
    ] = None
    host: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME", help="A name or address of the router beside those of this machine; may be repeated."
        ),
    ] = None
    slices: Annotated[int | None, typer.Option(metavar="N", help="Also one for each of N slices of the field.")] = None


@command(Certified)
def certificates(request: Certified) -> None:
    """Make the certificates of a secured run, for the hosts and containers that take part in it."""
    from functools import partial

    from launcher.blocks import blocks
    from launcher.plan.prepare import prepare
    from launcher.processes.places.desk import standing
    from launcher.security.folder import check_new
    from launcher.security.security import Wanted, made_in

    checks = [partial(check_new, request.out, "--out"), partial(_check_days, request.days)]
    speed = 1.0 if request.speed is None else request.speed
    _, plan = prepare(request.scenario, speed, checks, seed=request.seed, **request.options)
    shares = () if request.slices is None else blocks(standing(plan.in_slices), request.slices)
    wanted = Wanted(tuple(request.host or ()), request.ca, request.days, shares)
    made_in(request.out, plan, wanted, "--out")
    print(f"certificates of run {plan.run.run} in {request.out}", file=sys.stderr)


def _check_days(days: float | None) -> None:
    """Raise ``ScenarioError`` for what is no time for certificates."""
    from launcher.security.authority import MAX_DAYS
    from trackfield.errors import ScenarioError

    if days is not None and not 0 < days <= MAX_DAYS:
        raise ScenarioError(f"is {days:g}", key="--days", expected=f"more than 0, up to {MAX_DAYS:g}")


def router(
    listen: Annotated[
        list[str], typer.Option(metavar="ENDPOINT", help="Where to listen, like tcp/127.0.0.1:7447; may be repeated.")
    ],
    secure: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="The certificates of a run: nobody else is let in. For tls/... and quic/..."),
    ] = None,
    insecure: Annotated[
        bool, typer.Option("--insecure", help="Listen beyond this machine without certificates.")
    ] = False,
) -> None:
    """Run a Zenoh router for runs whose processes start elsewhere, until Ctrl-C."""
    from launcher.options import check_endpoint
    from launcher.processes.endpoint import serve
    from launcher.security.options import check_listen
    from trackfield.drivers.joining.credentials import SECURE

    for endpoint in listen:
        check_endpoint(endpoint, "--listen")
    check_listen(listen, secure=secure is not None, insecure=insecure)
    if secure is None:
        serve(listen)
        return
    from launcher.records import ROUTER
    from launcher.security.folder import checked_in, rules_in

    serve(listen, checked_in(secure, ROUTER, SECURE), rules_in(secure, SECURE))


def field(
    slice: Annotated[
        str,
        typer.Option(
            "--slice",
            metavar="I/N",
            help="Which of how many shares of the field, like 3/8; 0/8 is 8/8. With auto/8: any that is free.",
        ),
    ],
    connect: Annotated[
        str, typer.Option(metavar="ENDPOINT", help="Where the router of the run listens, like tcp/10.0.0.1:7447.")
    ],
    run: Annotated[str, typer.Option(metavar="ID", help="The run's id, if the router has several at a time.")] = "",
    wait: Annotated[bool, typer.Option("--wait", help="Wait for a router, a run and a free slice.")] = False,
    out: Annotated[Path | None, typer.Option(help="The folder of the logs; unset: slice-I-of-N.")] = None,
    secure: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="The certificates of the run, its guest's or its slices'; for tls/... and quic/..."
        ),
    ] = None,
) -> None:
    """Run a share of the field of a run that waits for it (--field external), on this host."""
    from launcher.options import check_endpoint
    from launcher.security.options import check_connect
    from launcher.slices.asking import Share
    from launcher.slices.command import Order
    from launcher.slices.command import field as run_field

    share = Share.parse(slice)
    check_endpoint(connect, "--connect")
    check_connect(connect, secure=secure is not None)
    raise typer.Exit(run_field(Order(share, connect, run, wait, out, secure)))
