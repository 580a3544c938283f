"""The folder with the certificates of a run: made once, copied to other hosts in part, and read by all."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.serialization import load_pem_private_key

from launcher.security.options import RUN
from trackfield.drivers.joining.credentials import AUTHORITY, GUEST, credentials_in
from trackfield.drivers.session import Credentials
from trackfield.errors import ScenarioError

RULES: Final = "router.json"
"""Settings of the run's router without secrets: what each certificate may do, and how much of it."""
_RUN: Final = re.compile(r"[^/*$?#\s]+")
"""What may begin the keys of a run."""
EXPECTED: Final = "a folder that trackfield certificates made"


@dataclass(frozen=True, slots=True)
class Facts:
    """What the certificates in a folder are for, and until when (ISO 8601, UTC) they are valid."""

    run: str
    scenario: str
    seed: int
    expires: str


def write(folder: Path, facts: Facts, issued: Mapping[str, Credentials], rules: Mapping[str, Any], key: str) -> None:
    """Make the folder, for its owner alone: certificates and keys by name, and what the router lets each do.

    Its folder ``guest`` has what a host or a container needs that claims any place. ``key`` is the option that names
    the folder. Raises ``ScenarioError`` if it cannot be written.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.chmod(0o700)
        (folder / GUEST).mkdir(mode=0o700)
        for name, one in issued.items():
            _write(folder / f"{name}.pem", one.certificate)
            _write(folder / f"{name}.key", one.key)
        guest = issued[GUEST]
        for file, text in ((AUTHORITY, guest.authority), ("guest.pem", guest.certificate), ("guest.key", guest.key)):
            _write(folder / GUEST / file, text)
        _write(folder / AUTHORITY, guest.authority)
        _write(folder / RULES, json.dumps(rules, indent=1) + "\n")
        _write(folder / RUN, json.dumps(asdict(facts), indent=1) + "\n")
    except OSError as error:
        what = f"cannot be written ({error.strerror})"
        file = str(error.filename or folder)
        raise ScenarioError(what, file=file, key=key, expected="a new or empty folder") from None


def check_new(folder: Path, key: str) -> None:
    """Raise ``ScenarioError`` unless certificates can be made in this folder; nothing is written."""
    there = next(one for one in (folder, *folder.absolute().parents) if one.exists())
    if not there.is_dir():
        raise ScenarioError("is no folder", file=str(there), key=key, expected="a new or empty folder")
    if not os.access(there, os.W_OK | os.X_OK):
        raise ScenarioError("cannot be written", file=str(there), key=key, expected="a new or empty folder")
    if there == folder and not is_empty(folder):
        raise ScenarioError("is not empty", file=str(folder), key=key, expected="a new or empty folder")


def is_empty(folder: Path) -> bool:
    """Whether there is nothing in it, or no such folder."""
    try:
        return not any(folder.iterdir())
    except FileNotFoundError:
        return True
    except OSError:  # no folder, or not ours to read: whoever reads what is in it says so
        return False


def facts_of(folder: Path, key: str) -> Facts:
    """What this folder is for; ``key`` is the option that names it. Raises ``ScenarioError``."""
    found = _json(folder / RUN, key)
    try:
        facts = Facts(**found)
        right = type(facts.scenario) is str and type(facts.seed) is int and _RUN.fullmatch(facts.run)
        if not right or datetime.fromisoformat(facts.expires).tzinfo is None:
            raise ValueError
    except (TypeError, ValueError):
        raise ScenarioError("does not say what it is for", file=str(folder / RUN), key=key, expected=EXPECTED) from None
    return facts


def rules_in(folder: Path, key: str) -> dict[str, Any]:
    """The router's settings that this folder has. Raises ``ScenarioError``, also for those that let everybody in."""
    rules = _json(folder / RULES, key)
    access = rules.get("access_control")
    told = access if type(access) is dict else {}
    denies = told.get("enabled") is True and told.get("default_permission") == "deny"
    if not denies or not all(type(rule) is dict for rule in told.get("rules") or [None]):
        raise ScenarioError(
            "does not say what each certificate may do", file=str(folder / RULES), key=key, expected=EXPECTED
        )
    return rules


def checked_in(folder: Path, name: str, key: str) -> Credentials:
    """The credentials of ``name``, valid now, from the authority of this folder. Raises ``ScenarioError``."""
    found = credentials_in(folder, name, key)
    file = str(folder / f"{name}.pem")
    try:
        certificate = x509.load_pem_x509_certificate(found.certificate.encode())
        authority = x509.load_pem_x509_certificate(found.authority.encode())
        private = load_pem_private_key(found.key.encode(), None)
    except (ValueError, TypeError) as error:
        what = f"is damaged ({str(error).partition('.')[0]})"
        raise ScenarioError(what, file=file, key=key, expected=EXPECTED) from None
    if what := _flaw(certificate, authority, private, name):
        raise ScenarioError(what, file=file, key=key, expected=EXPECTED)
    return found


def _flaw(certificate: x509.Certificate, authority: x509.Certificate, key: Any, name: str) -> str:
    """What is wrong with a certificate, or nothing."""
    names = [part.value for part in certificate.subject.get_attributes_for_oid(x509.NameOID.COMMON_NAME)]
    now, expires = datetime.now(UTC), certificate.not_valid_after_utc
    try:
        certificate.verify_directly_issued_by(authority)
    except (ValueError, TypeError, InvalidSignature):
        return f"is not from the authority in {AUTHORITY}"
    if names != [name]:
        return f"is the certificate of {', '.join(map(str, names)) or 'nobody'}"
    if key.public_key() != certificate.public_key():
        return f"is not for the key in {name}.key"
    if not certificate.not_valid_before_utc <= now < expires:
        return f"is not valid now, at {now:%Y-%m-%d %H:%M:%S} UTC: it expires at {expires:%Y-%m-%d %H:%M:%S} UTC"
    return ""


def missing(folder: Path, names: Iterable[str]) -> list[str]:
    """Those who have no certificate or no key in this folder."""
    return sorted(n for n in names if not all((folder / f"{n}{end}").exists() for end in (".pem", ".key")))


def _write(file: Path, text: str) -> None:
    with os.fdopen(os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as opened:
        opened.write(text)


def _json(file: Path, key: str) -> dict[str, Any]:
    try:
        found = json.loads(file.read_text())
    except OSError as error:
        what = f"cannot be read ({error.strerror})"
        raise ScenarioError(what, file=str(file), key=key, expected=EXPECTED) from None
    except (ValueError, RecursionError):
        raise ScenarioError("is damaged", file=str(file), key=key, expected=EXPECTED) from None
    if type(found) is not dict:
        raise ScenarioError("is damaged", file=str(file), key=key, expected=EXPECTED)
    return found
