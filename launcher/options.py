"""What the options of a run must be, and must not be together."""

from __future__ import annotations

from trackfield.drivers.session import PROTOCOLS, is_endpoint
from trackfield.errors import ScenarioError


def check_endpoint(endpoint: str, option: str) -> None:
    """Raise ``ScenarioError`` unless this can be where a Zenoh router listens."""
    if not is_endpoint(endpoint):
        expected = f"PROTOCOL/ADDRESS, like tcp/127.0.0.1:7447 (protocols: {', '.join(PROTOCOLS)})"
        raise ScenarioError(f"is {endpoint!r}", key=option, expected=expected)


def check_driver(*, virtual: bool, external: bool, live: bool, connect: str) -> None:
    """Raise ``ScenarioError`` if these options contradict each other, ``RunFailed`` if what they need is missing."""
    if external and virtual:
        raise ScenarioError("there are no processes in virtual time", key="--external", expected="it without --virtual")
    if live and virtual:
        expected = "it without --virtual, or the timeline afterwards: trackfield view RUN"
        raise ScenarioError("a run in virtual time is over at once", key="--live", expected=expected)
    if live:
        from launcher.timeline.view import program  # loads Rerun

        program()
    if external and not connect:
        raise ScenarioError("nobody can find a router of our own", key="--external", expected="--connect beside it")
