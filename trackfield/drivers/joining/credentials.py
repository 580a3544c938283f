"""The certificate of a process that starts elsewhere, as it is in a folder or comes with the answer to its claim."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import zenoh

from trackfield.drivers.joining.ask import JoinError
from trackfield.drivers.session import Credentials, open_client
from trackfield.errors import ScenarioError

AUTHORITY: Final = "authority.pem"
"""In such a folder, the certificate of the run's authority; others are called as who has them, with ``.key`` beside."""
GUEST: Final = "guest"
"""The name on a certificate that is no process's yet, but may claim a place."""
SECURE: Final = "--secure"
TRIES, TRY_S = 11, 5.0
"""How often, and how long each time (s), a process looks for the router before it says that there is none."""
HANDSHAKE_S: Final = 5.0
"""How long a router may take to refuse a certificate."""
_MARKS: Final = {".pem": "-----BEGIN CERTIFICATE-----", ".key": "PRIVATE KEY-----"}


class CertificateError(JoinError):
    """This process and the router do not accept each other's certificate."""


def credentials_in(folder: Path, name: str, key: str = SECURE) -> Credentials:
    """Those of ``name`` in this folder; ``key`` is the option that names it. Raises ``ScenarioError``."""
    files = folder / AUTHORITY, folder / f"{name}.pem", folder / f"{name}.key"
    return Credentials(*(_text(file, key) for file in files))


def plain(credentials: Credentials) -> dict[str, str]:
    """The form that is sent to a guest, who knows the authority."""
    return {"certificate": credentials.certificate, "key": credentials.key}


def open_shown(endpoint: str, run: str | None, credentials: Credentials | None) -> zenoh.Session:
    """As ``open_client``. Raises ``CertificateError`` if a certificate is why no router answers."""
    for _ in range(TRIES):
        try:
            return open_client(endpoint, run, TRY_S, credentials)
        except zenoh.ZError:
            if why := refusal(endpoint, credentials):
                raise CertificateError(why) from None
    return open_client(endpoint, run, TRY_S, credentials)


def refusal(endpoint: str, credentials: Credentials | None) -> str:
    """Why a router refuses these credentials, or this process the router, as far as another handshake shows it.

    Zenoh tells neither. Empty if it cannot be told.
    """
    if credentials is None or not endpoint.startswith("tls/"):
        return ""
    import socket
    import ssl

    host, _, port = endpoint.removeprefix("tls/").rpartition(":")
    host = host.strip("[]")
    try:
        context = _context(credentials)
        with (
            socket.create_connection((host, int(port)), HANDSHAKE_S) as bare,
            context.wrap_socket(bare, server_hostname=host) as link,
        ):
            link.recv(1)  # a certificate is refused after the handshake (RFC 8446, 4.4.2.4)
    except ssl.SSLCertVerificationError as error:
        return f"the router's certificate is not what the authority in {AUTHORITY} says ({error.verify_message})"
    except ssl.SSLError as error:
        said = str(error.reason or "").lower().replace("_", " ").rpartition("alert ")[2]
        return f"the router refuses the certificate of this process ({said})"
    except (OSError, ValueError):
        return ""  # there is no router
    return ""


def _context(credentials: Credentials) -> Any:
    """Those credentials as Python's own TLS takes them, which reads certificates from files only."""
    import os
    import ssl

    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.load_verify_locations(cadata=credentials.authority)
    context.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN  # the run's authority may have been certified by another
    with os.fdopen(os.memfd_create("certificate"), "w") as file:
        file.write(f"{credentials.certificate}{credentials.key}")
        file.flush()
        context.load_cert_chain(f"/proc/self/fd/{file.fileno()}")
    return context


def _text(file: Path, key: str) -> str:
    expected = f"a folder with {AUTHORITY}, and the certificate of this process or {GUEST}.pem, with keys"
    try:
        text = file.read_text()
    except (OSError, ValueError) as error:
        what = f"cannot be read ({getattr(error, 'strerror', None) or 'no text'})"
        raise ScenarioError(what, file=str(file), key=key, expected=expected) from None
    if _MARKS[file.suffix] not in text:
        raise ScenarioError("is no PEM of that", file=str(file), key=key, expected=expected)
    return text
