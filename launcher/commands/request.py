"""Requests for runs: the arguments and options of ``run``, ``validate`` and ``study``, as fields of dataclasses."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, get_type_hints

import typer

from launcher.commands.arguments import (
    CertificateAuthority,
    End,
    LinkModel,
    Name,
    Nodes,
    Sensors,
    Set,
    Speed,
    Start,
    Target,
    Trackers,
)

if TYPE_CHECKING:
    from launcher.records import Plan
    from launcher.security.security import Security
    from trackfield.scenario import Scenario


Asked = TypeVar("Asked", bound="Changed")


@dataclass(frozen=True)
class Changed:
    """A scenario, and what is changed in it; each field is an option of the command line."""

    scenario: Name
    overrides: Set = None
    target: Target = None
    start: Start = None
    end: End = None
    sensors: Sensors = None
    nodes: Nodes = None
    link: LinkModel = None
    tracker: Trackers = None

    @property
    def options(self) -> dict[str, Any]:
        """The changes, as ``launcher.plan.prepare.changes`` takes them."""
        return {
            "settings": self.overrides or (),
            "target": self.target,
            "start": self.start,
            "end": self.end,
            "sensors": self.sensors,
            "nodes": self.nodes,
            "link": self.link,
            "trackers": self.tracker or (),
        }


@dataclass(frozen=True)
class Request(Changed):
    """A changed scenario, and how it is to be run: the options of ``run`` and ``validate``."""

    seed: Annotated[int | None, typer.Option(help="The seed of every random draw; unset: the scenario's own.")] = None
    speed: Speed = None
    virtual: Annotated[bool, typer.Option("--virtual", help="Run in virtual time, in a single process.")] = False
    out: Annotated[Path | None, typer.Option(help="The run folder; new or empty.")] = None
    live: Annotated[bool, typer.Option("--live", help="Show the run in the browser while it goes on.")] = False
    live_at: Annotated[
        str,
        typer.Option(
            metavar="HOST:PORT", help="Show the run while it goes on by a viewer that is there (trackfield view --web)."
        ),
    ] = ""
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON, and nothing else, to stdout.")] = (
        False
    )
    connect: Annotated[
        str,
        typer.Option(metavar="ENDPOINT", help="Use the Zenoh router at this endpoint, like tcp/127.0.0.1:7447."),
    ] = ""
    listen: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT",
            help="Let the run's own router listen here as well, like tls/0.0.0.0:7447, for processes that start "
            "elsewhere; may be repeated.",
        ),
    ] = None
    external: Annotated[
        bool,
        typer.Option("--external", help="Wait for all processes, which start elsewhere and join at the router."),
    ] = False
    field: Annotated[
        str,
        typer.Option(
            metavar="external",
            help="With external: wait for the processes in the field, which start elsewhere (trackfield field); the "
            "others start here.",
        ),
    ] = ""
    wait: Annotated[
        float | None,
        typer.Option(metavar="S", help="How long to wait for processes that start elsewhere; unset: 300 s."),
    ] = None
    secure: Annotated[
        bool, typer.Option("--secure", help="Let all processes show certificates, and do only what is theirs to do.")
    ] = False
    certificates: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="With --secure: the certificates that trackfield certificates made, or a new folder for some; unset: "
            "they are nowhere but in the processes.",
        ),
    ] = None
    ca: CertificateAuthority = None
    insecure: Annotated[
        bool,
        typer.Option("--insecure", help="Listen beyond this machine without certificates: whoever comes is let in."),
    ] = False
    bridge: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ID=DEVICE",
            help="Put a real device, like base=/dev/ttyUSB0, in the place of a process with a serial line, or, with "
            "ID=pty, a pseudo-terminal that the run makes; may be repeated.",
        ),
    ] = None
    serial: Annotated[
        list[str] | None,
        typer.Option(
            metavar="DEVICE",
            help="Put a real camera, like /dev/ttyUSB0, in the place of the field's own, or, with pty, "
            "a pseudo-terminal that the run makes: --bridge camera=DEVICE.",
        ),
    ] = None
    quiet: Annotated[bool, typer.Option("--quiet", help="Print errors only.")] = False

    def prepared(self) -> tuple[Scenario, Plan]:
        """The scenario and its plan. Raises ``ScenarioError`` with all that is wrong with this request."""
        from launcher.options import check_driver, check_elsewhere, check_endpoint, check_viewer_at
        from launcher.plan.bridges import OPTION, SERIAL, bridged, check_camera, looked_for, with_camera
        from launcher.plan.prepare import prepare
        from launcher.record.folder import check_folder

        bridges, cameras = self.bridge or (), self.serial or ()
        scenario, plan = prepare(
            self.scenario,
            1.0 if self.speed is None else self.speed,
            [
                partial(
                    check_driver,
                    virtual=self.virtual,
                    external=self.external,
                    field=self.field,
                    wait_s=self.wait,
                    live="--live" if self.live else "--live-at" if self.live_at else "",
                    connect=self.connect,
                    listen=bool(self.listen),
                    speed=self.speed,
                    bridged=SERIAL if cameras else OPTION if bridges else "",
                ),
                partial(with_camera, bridges, cameras),
                *([partial(check_endpoint, self.connect, "--connect")] if self.connect else []),
                *(partial(check_endpoint, endpoint, "--listen") for endpoint in self.listen or ()),
                *([partial(check_viewer_at, self.live_at)] if self.live_at else []),
                *([partial(check_folder, self.out)] if self.out else []),
                self._check_security,
            ],
            seed=self.seed,
            **self.options,
        )
        check_camera(plan, cameras)
        if self.certificates:
            from launcher.security.security import named_in  # loads what makes certificates

            plan = named_in(plan, self.certificates)
        plan = bridged(plan, with_camera(bridges, cameras))
        check_elsewhere(
            plan,
            self.elsewhere(plan),
            reachable=bool(self.connect or self.listen),
            certified=not self.secure or bool(self.certificates),
            virtual=self.virtual,
        )
        return scenario, looked_for(plan)

    def _check_security(self) -> None:
        """Raise ``ScenarioError`` for what contradicts ``--secure``, or needs it."""
        from launcher.security.options import check_security

        check_security(
            secure=self.secure,
            certificates=self.certificates,
            ca=self.ca,
            insecure=self.insecure,
            virtual=self.virtual,
            guests=self.external or bool(self.field),
            connect=self.connect,
            listen=self.listen or (),
        )

    def security(self, plan: Plan) -> Security | None:
        """The certificates of the run, if it is secured. Raises ``ScenarioError`` if they are not to be had."""
        if not self.secure:
            return None
        from launcher.security.options import hosts_of
        from launcher.security.security import secured

        return secured(plan, self.certificates, hosts_of(self.listen or ()), self.ca, router=not self.connect)

    def elsewhere(self, plan: Plan) -> frozenset[str]:
        """The ids of the processes that start elsewhere."""
        chosen = plan.ids if self.external else plan.in_field if self.field else frozenset()
        return chosen | set(plan.external)

    def check_machine(self, plan: Plan) -> None:
        """Raise ``RunFailed`` if this machine cannot do such a run, ``ScenarioError`` for classes that no other process
        can import.
        """
        from launcher.options import check_viewer

        if not self.virtual:
            from launcher.plan.extensions import check_importable

            check_importable(plan)
            from launcher.processes.limits import check_machine  # loads Zenoh

            check_machine(plan, router=not self.connect, guests=len(self.elsewhere(plan)))
        if self.live:
            check_viewer()


def command(kind: type[Asked]) -> Callable[[Callable[[Asked], None]], Callable[..., None]]:
    """Make a function of a ``kind`` of request a command of the command line that takes all its options."""

    def of(body: Callable[[Asked], None]) -> Callable[..., None]:
        def call(**options: object) -> None:
            body(kind(**options))  # type: ignore[arg-type]

        call.__name__, call.__doc__ = body.__name__, body.__doc__
        hints = call.__annotations__ = get_type_hints(kind, include_extras=True)
        taken = inspect.signature(kind).parameters.values()
        call.__signature__ = inspect.Signature([one.replace(annotation=hints[one.name]) for one in taken])  # type: ignore[attr-defined]
        return call

    return of
