"""Certificates of a run, and what a hostile peer shows in their place.

The authorities of all runs here are certified by one that they have in common, as with ``--ca``.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, Final

import trustme

from launcher.records import Plan
from launcher.security.access import TOOLS
from launcher.security.authority import AUTHORITY, Authority
from launcher.security.folder import Facts, write
from launcher.security.options import CERTIFICATES
from launcher.security.security import Wanted, made
from trackfield.drivers.session import Credentials, client_settings

THIEF: Final = "n003"
"""The node whose certificate a peer has."""
HOUR_S: Final = 3600.0


class Shown(Enum):
    """What a peer shows."""

    NONE = "no certificate"
    FORGED = "one of a forged authority"
    EXPIRED = "an expired one"
    ANOTHER_RUNS = "one of another run"
    NODES = "a node's"


WHY: Final = {
    Shown.NONE: "none",
    Shown.FORGED: "of another authority",
    Shown.EXPIRED: "expired",
    Shown.ANOTHER_RUNS: "of another authority",
}
"""What a run calls a certificate with which nobody comes in."""


@dataclass(frozen=True)
class Papers:
    """The certificates of a run in ``folder``, and the settings of its router."""

    folder: Path
    router: dict[str, Any]
    shown: dict[Shown, Credentials]

    def settings(self, shown: Shown, endpoint: str, run: str, timeout_s: float) -> str:
        """Those of a session of a peer that shows this."""
        settings = json.loads(client_settings(endpoint, run, timeout_s, self.shown[shown]))
        if shown is Shown.NONE:
            link = settings["transport"]["link"]
            link["tls"] = {"root_ca_certificate_base64": link["tls"]["root_ca_certificate_base64"]}
        return json.dumps(settings)

    def may(self, name: str, message: str) -> list[str]:
        """The key expressions at which the holder of this certificate may send such messages."""
        access = self.router["access_control"]
        own = {rule for policy in access["policies"] if name in policy["subjects"] for rule in policy["rules"]}
        rules = [rule for rule in access["rules"] if rule["id"] in own and message in rule["messages"]]
        return [key for rule in rules if "ingress" in rule["flows"] for key in rule["key_exprs"]]

    def limits(self, message: str) -> list[tuple[str, int]]:
        """The most bytes of such messages, by key expression."""
        limits = [limit for limit in self.router["low_pass_filter"] if message in limit["messages"]]
        return [(key, limit["size_limit"]) for limit in limits for key in limit["key_exprs"]]


@cache
def _root() -> trustme.CA:
    return trustme.CA(organization_name="Trackfield")


def papers(plan: Plan, home: Path) -> Papers:
    """Certificates for a run of this plan in a new folder, as ``trackfield certificates --ca`` makes them."""
    ca = home / "ca"
    ca.mkdir(parents=True)
    (ca / f"{AUTHORITY}.pem").write_bytes(_root().cert_pem.bytes())
    (ca / f"{AUTHORITY}.key").write_bytes(_root().private_key_pem.bytes())
    security, own = made(plan, Wanted(ca=ca))
    run, folder = plan.run.run, home / "certificates"
    facts = Facts(run, plan.info.scenario, plan.run.seed, own.expires.isoformat(timespec="seconds"))
    write(
        folder,
        facts,
        {name: security.credentials(name) for name in [*TOOLS, *plan.ids]},
        security.settings,
        CERTIFICATES,
    )
    valid = security.credentials(THIEF)

    def by(authority: Authority) -> Credentials:
        """A peer knows the certificate of the run's authority, and shows one that another made."""
        return replace(authority.issue(THIEF), authority=valid.authority)

    shown = {
        Shown.NONE: valid,
        Shown.FORGED: by(Authority(run, HOUR_S)),
        Shown.EXPIRED: own.issue(THIEF, datetime.now(UTC) - timedelta(seconds=1)),
        Shown.ANOTHER_RUNS: by(Authority(f"{run}-2", HOUR_S, ca=ca)),
        Shown.NODES: valid,
    }
    return Papers(folder, dict(security.settings), shown)
