"""Checks of the options of a run, alone and together."""

from __future__ import annotations

from trackfield.drivers.session import PROTOCOLS, is_endpoint
from trackfield.errors import ScenarioError, combined


def check_endpoint(endpoint: str, option: str) -> None:
    """Raise ``ScenarioError`` unless this can be where a Zenoh router listens."""
    if not is_endpoint(endpoint):
        expected = f"PROTOCOL/ADDRESS, like tcp/127.0.0.1:7447 (protocols: {', '.join(PROTOCOLS)})"
        raise ScenarioError(f"is {endpoint!r}", key=option, expected=expected)


def check_driver(
    *, virtual: bool, external: bool, live: bool, connect: str, speed: float | None, bridged: str = ""
) -> None:
    """Raise ``ScenarioError`` with all options that contradict others, or have no effect beside them.

    ``bridged`` is the option that puts a real device in the place of a process, or empty.
    """
    viewed = "it without --virtual, or the timeline afterwards: trackfield view RUN"
    alone = "it without --virtual"
    rules = (
        (external and virtual, "--external", "there are no processes in virtual time", alone),
        (live and virtual, "--live", "a run in virtual time is over at once", viewed),
        (speed is not None and virtual, "--speed", "virtual time goes as fast as the machine can", alone),
        (bool(bridged) and virtual, bridged, "there is no device in virtual time", alone),
        (bool(bridged) and external, bridged, "the processes start elsewhere", "it without --external"),
        (bool(bridged) and speed not in (None, 1), bridged, "a device goes by the wall clock", "it with --speed 1"),
        (bool(connect) and virtual, "--connect", "a run in virtual time uses no router", alone),
        (
            external and not connect,
            "--external",
            "other processes cannot find the run's own router",
            "--connect as well",
        ),
    )
    wrong = [ScenarioError(what, key=key, expected=expected) for broken, key, what, expected in rules if broken]
    if wrong:
        raise combined(wrong)


def check_viewer() -> None:
    """Raise ``RunFailed`` if there is no viewer for a live view."""
    from launcher.timeline.program import program

    program()
