"""Zenoh sessions with the settings that a field of a thousand processes needs."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import zenoh

NODE_RUNTIME: Final = "(rx:(handover:app),acc:(handover:app),tx:(handover:app),net:(handover:app))"
"""ZENOH_RUNTIME of a node: half the threads. Not for the router, which would lose frames with it."""

PROTOCOLS: Final = ("tcp", "tls", "quic", "udp", "ws", "unixsock-stream")
"""What Zenoh can listen on."""
SECURED: Final = ("tls", "quic")
"""Those of them on which both sides show certificates."""

_PATIENCE: Final[Mapping[str, Any]] = {
    # In microseconds (default 1000): a receiver that waits for the processor costs no frame.
    "transport/link/tx/queue/congestion_control/drop/wait_before_drop": 1_000_000,
}
_CLIENT: Final[Mapping[str, Any]] = {
    "mode": "client",
    "listen/endpoints": [],
    "scouting/multicast/enabled": False,
    "transport/shared_memory/enabled": False,
    "connect/retry": {"period_init_ms": 50, "period_max_ms": 500, "period_increase_factor": 1.5},
    **_PATIENCE,
}
_ROUTER: Final[Mapping[str, Any]] = {
    "mode": "router",
    "scouting/multicast/enabled": False,
    "transport/shared_memory/enabled": False,
    "transport/unicast": {"max_sessions": 4000, "accept_pending": 4000, "accept_timeout": 60_000},
    "transport/link/tx/queue/size/data": 16,  # batches that wait for a receiver (default 2)
    **_PATIENCE,
}


def is_endpoint(text: str) -> bool:
    """Whether this can be where a router listens."""
    protocol, _, place = text.partition("/")
    return protocol in PROTOCOLS and bool(place)


@dataclass(frozen=True, slots=True)
class Credentials:
    """How a process shows who it is, and knows others: texts in PEM.

    The certificates of the ``authority`` that it trusts, its own ``certificate``, with those between it and the
    authority if there are any, and its private ``key``.
    """

    authority: str
    certificate: str
    key: str


def open_client(
    endpoint: str, run: str | None = None, timeout_s: float = 60.0, credentials: Credentials | None = None
) -> zenoh.Session:
    """A session in a run (None: all runs) by the router at ``endpoint``. Raises ``zenoh.ZError`` if none answers."""
    return open_session(client_settings(endpoint, run, timeout_s, credentials))


def client_settings(
    endpoint: str, run: str | None = None, timeout_s: float = 60.0, credentials: Credentials | None = None
) -> str:
    """The settings of such a session. The launcher makes them for its nodes, as that takes memory."""
    timeout = {"connect/timeout_ms": round(timeout_s * 1000)}
    namespace = {} if run is None else {"namespace": run}
    places = {"connect/endpoints": [endpoint]}
    return _settings({**_CLIENT, **timeout, **namespace, **places, **_secured(credentials)})


def open_router(*endpoints: str) -> zenoh.Session:
    """A router that listens at these endpoints for as long as the session is kept."""
    return open_session(router_settings(endpoints))


def router_settings(
    endpoints: Sequence[str],
    credentials: Credentials | None = None,
    upstream: str = "",
    more: Mapping[str, Any] | None = None,
) -> str:
    """The settings of a router at these endpoints, one of another's (``upstream``), if given.

    ``more`` are further settings by their paths.
    """
    places = {"listen/endpoints": list(endpoints), "connect/endpoints": [upstream] if upstream else []}
    return _settings({**_ROUTER, **places, **_secured(credentials), **(more or {})})


def _secured(credentials: Credentials | None) -> dict[str, Any]:
    """Both sides of each link show and check certificates, and a link ends when one of them expires."""
    if credentials is None:
        return {}
    authority, certificate, key = (
        b64encode(text.encode()).decode() for text in (credentials.authority, credentials.certificate, credentials.key)
    )
    tls = {
        "root_ca_certificate_base64": authority,
        "enable_mtls": True,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
        **{f"{side}_certificate_base64": certificate for side in ("listen", "connect")},
        **{f"{side}_private_key_base64": key for side in ("listen", "connect")},
    }
    return {"transport/link/tls": tls}


def open_session(settings: str) -> zenoh.Session:
    """A session with these settings. Raises ``zenoh.ZError`` if they are a client's and no router answers."""
    return zenoh.open(zenoh.Config.from_json5(settings))


def _settings(paths: Mapping[str, Any]) -> str:
    """The tree of these paths in JSON: a configuration read as a whole takes less memory than one set key by key."""
    tree: dict[str, Any] = {}
    for path, value in paths.items():
        *branches, leaf = path.split("/")
        at = tree
        for branch in branches:
            at = at.setdefault(branch, {})
        at[leaf] = value
    return json.dumps(tree)
