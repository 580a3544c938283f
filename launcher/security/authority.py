"""The authority of one run: it certifies the run's processes, and those of no other run."""

from __future__ import annotations

import ipaddress
import math
import re
import socket
from collections.abc import Iterable
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

import trustme
from cryptography import x509
from cryptography.hazmat.primitives.serialization import load_pem_private_key

from launcher.records import ROUTER
from trackfield.drivers.session import Credentials
from trackfield.errors import ScenarioError

AUTHORITY: Final = "authority"
"""What the files of an authority are called, ``authority.pem`` and ``authority.key``."""
DAY_S: Final = 86_400.0
LENGTHS: Final = 2.0
"""So many times as long as its run a certificate is valid, but a day at least."""
MAX_DAYS: Final = 3650.0
SKEW: Final = timedelta(hours=1)
"""A certificate is valid from so long ago on: the clocks of other hosts may be late."""
_UNIT: Final = 64
"""The longest name of a unit in a certificate (X.520)."""
_LABEL: Final = "[A-Za-z0-9]([A-Za-z0-9-]{0,61}[A-Za-z0-9])?"
_HOST: Final = re.compile(rf"(?=.{{1,253}}$)({_LABEL}\.)*{_LABEL}")
_NOBODY: Final = "process.invalid"
"""The host that a process's certificate names: there is none (RFC 2606), so that it cannot pass for a router's."""


def lifetime_s(length_s: float, days: float | None = None) -> float:
    """How long certificates of a run of this ``length_s`` (s of real time) are valid, unless it is so many ``days``."""
    return max(DAY_S, LENGTHS * length_s) if days is None else days * DAY_S


class Authority:
    """The authority of the run ``run``, certified by the one in the folder ``ca`` if there is one.

    Its key is never written. ``hosts`` are the names and addresses of the router beside those of this machine;
    certificates are valid for ``lifetime_s`` (s) from now. Raises ``ScenarioError`` for a folder ``ca`` without an
    authority that will do, or what is no host.
    """

    def __init__(self, run: str, lifetime_s: float, hosts: Iterable[str] = (), ca: Path | None = None) -> None:
        parent = None if ca is None else _read(ca)
        self._ca = trustme.CA(parent, path_length=0, organization_name="Trackfield", organization_unit_name=run[:_UNIT])
        self._unit = run[:_UNIT]
        self._hosts = tuple(dict.fromkeys([*_local(), *map(check_host, hosts)]))
        self.expires = datetime.now(UTC) + timedelta(seconds=math.ceil(lifetime_s))
        self.certificate = self._ca.cert_pem.bytes().decode()

    def issue(self, name: str, expires: datetime | None = None) -> Credentials:
        """A certificate with this common name, and its key; it expires with all others, or when it is told to."""
        made = self._ca.issue_cert(
            *(self._hosts if name == ROUTER else (_NOBODY,)),
            common_name=name,
            organization_name="Trackfield",
            organization_unit_name=self._unit,
            not_before=datetime.now(UTC) - SKEW,
            not_after=expires or self.expires,
        )
        chain = "".join(part.bytes().decode() for part in made.cert_chain_pems)
        return Credentials(self.certificate, chain, made.private_key_pem.bytes().decode())


def check_host(text: str) -> str:
    """``text`` if it is an address or a name of a host. Raises ``ScenarioError``."""
    with suppress(ValueError):
        return str(ipaddress.ip_address(text))
    if _HOST.fullmatch(text):
        return text.lower()
    raise ScenarioError(f"{text!r} is no host", key="--host", expected="an address, or letters, digits, - and .")


def _local() -> list[str]:
    """The names and addresses by which a router on this machine is found."""
    own = socket.gethostname()
    return ["localhost", "127.0.0.1", "::1", *([own.lower()] if _HOST.fullmatch(own) else [])]


def _read(folder: Path) -> trustme.CA:
    """The authority in a folder. Raises ``ScenarioError``."""
    expected = f"a folder with {AUTHORITY}.pem, the certificate of an authority, and {AUTHORITY}.key, its key"
    file = folder / f"{AUTHORITY}.pem"
    try:
        certificate, key = file.read_bytes(), file.with_suffix(".key").read_bytes()
        if what := _flaw(certificate, key):
            raise ScenarioError(what, file=str(file), key="--ca", expected=expected)
        return trustme.CA.from_pem(certificate, key)
    except OSError as error:
        what = f"cannot be read ({error.strerror})"
        raise ScenarioError(what, file=str(error.filename), key="--ca", expected=expected) from None
    except (ValueError, TypeError) as error:  # no PEM; a key with a password
        what = f"holds no authority ({str(error).partition('.')[0]})"
        raise ScenarioError(what, file=str(folder), key="--ca", expected=expected) from None


def _flaw(certificate: bytes, key: bytes) -> str:
    """What is wrong with an authority that is to certify another, or nothing. Raises ``ValueError``, ``TypeError``."""
    found, now = x509.load_pem_x509_certificate(certificate), datetime.now(UTC)
    try:
        basic = found.extensions.get_extension_for_class(x509.BasicConstraints).value
        found.extensions.get_extension_for_class(x509.SubjectKeyIdentifier)
    except x509.ExtensionNotFound as error:
        return f"is no certificate of an authority ({error})"
    if not basic.ca or basic.path_length == 0:
        return "is the certificate of one that may certify no other authority"
    if not found.not_valid_before_utc <= now < found.not_valid_after_utc:
        return f"is valid from {found.not_valid_before_utc:%Y-%m-%d} to {found.not_valid_after_utc:%Y-%m-%d}"
    if load_pem_private_key(key, None).public_key() != found.public_key():
        return f"is not for the key in {AUTHORITY}.key"
    return ""
