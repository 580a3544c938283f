"""Which options and endpoints go with certificates, and which endpoints nobody beyond this machine can reach."""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final

from trackfield.drivers.session import SECURED
from trackfield.errors import ScenarioError, combined

CERTIFICATES: Final = "--certificates"
RUN: Final = "run.json"
"""In a folder of certificates, what they are for; written last."""
_SOCKET: Final = "unixsock-stream/"
_ANY: Final = ("0.0.0.0", "::")


def host_of(endpoint: str) -> str:
    """The host of ``protocol/host:port`` or ``protocol/[address]:port``, with whatever Zenoh takes behind it."""
    place = endpoint.partition("/")[2].partition("?")[0].partition("#")[0]
    return place.rpartition(":")[0].strip("[]").partition("%")[0]


def hosts_of(endpoints: Iterable[str]) -> tuple[str, ...]:
    """The hosts that these endpoints name, for the certificate of a router there."""
    return tuple(host for host in map(host_of, endpoints) if host not in _ANY)


def is_local(endpoint: str) -> bool:
    """Whether this is an endpoint of this machine alone."""
    if endpoint.startswith(_SOCKET):
        return True
    try:
        return ipaddress.ip_address(host_of(endpoint)).is_loopback
    except ValueError:
        return host_of(endpoint) == "localhost"


def check_listen(endpoints: Iterable[str], *, secure: bool, insecure: bool) -> None:
    """Raise ``ScenarioError`` if a router would let in strangers at any of these endpoints, unless that is wanted."""
    if errors := list(_listening(endpoints, secure, insecure)):
        raise combined(errors)


def check_connect(endpoint: str, *, secure: bool) -> None:
    """Raise ``ScenarioError`` unless certificates go with this endpoint if there are some, and only then."""
    if errors := list(_connecting(endpoint, secure)):
        raise combined(errors)


def check_security(
    *,
    secure: bool,
    certificates: Path | None,
    ca: Path | None,
    insecure: bool,
    virtual: bool,
    guests: bool,
    connect: str,
    listen: Sequence[str],
) -> None:
    """Raise ``ScenarioError`` for options of a secured run that contradict each other, or lack what they need."""
    made = certificates is not None and (certificates / RUN).exists()
    elsewhere = guests or bool(connect)
    rules = (
        (secure and virtual, "--secure", "in virtual time there is nobody to keep out", "it without --virtual"),
        (secure and insecure, "--insecure", "with --secure nobody comes in without a certificate", "one of the two"),
        (insecure and not listen, "--insecure", "nobody else comes to the run's own router", "it with --listen"),
        (not secure and bool(certificates), CERTIFICATES, "without --secure there are none", "--secure as well"),
        (not secure and bool(ca), "--ca", "without --secure there are no certificates", "--secure as well"),
        (bool(ca) and made, "--ca", "the certificates are there already", f"it without, or with a new {CERTIFICATES}"),
        (
            secure and certificates is None and elsewhere,
            "--secure",
            "what starts elsewhere needs certificates of this run",
            f"{CERTIFICATES} DIR as well",
        ),
        (
            secure and bool(connect) and certificates is not None and not made,
            CERTIFICATES,
            "the router of --connect does not know certificates that are made now",
            "a folder that trackfield certificates made, which the router has, too",
        ),
    )
    wrong = [ScenarioError(what, key=key, expected=expected) for broken, key, what, expected in rules if broken]
    wrong += [*_listening(listen, secure, insecure), *(_connecting(connect, secure) if connect else ())]
    if wrong:
        raise combined(wrong)


def _listening(endpoints: Iterable[str], secure: bool, insecure: bool) -> Iterator[ScenarioError]:
    for endpoint in endpoints:
        protocol = endpoint.partition("/")[0]
        if secure and protocol not in SECURED:
            what, expected = f"{endpoint} has no certificates", f"one that can be secured: {', '.join(SECURED)}"
        elif not secure and protocol in SECURED:
            what, expected = f"{endpoint} needs certificates", "--secure as well, or tcp"
        elif not (secure or insecure or is_local(endpoint)):
            what = f"whoever reaches {endpoint} could join, listen and give orders"
            expected = f"--secure with one of {', '.join(SECURED)}, or --insecure if that is wanted"
        else:
            continue
        yield ScenarioError(what, key="--listen", expected=expected)


def _connecting(endpoint: str, secure: bool) -> Iterator[ScenarioError]:
    protocol = endpoint.partition("/")[0]
    if secure and protocol not in SECURED:
        expected = f"one that can be secured: {', '.join(SECURED)}"
        yield ScenarioError(f"{endpoint} has no certificates", key="--connect", expected=expected)
    if not secure and protocol in SECURED:
        yield ScenarioError(f"{endpoint} needs certificates", key="--connect", expected="--secure as well")
