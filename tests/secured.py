"""Secured runs, and routers and processes of them that are started by hand."""

from __future__ import annotations

import signal
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import zenoh

from launcher.records import ROUTER
from launcher.security.security import Security
from tests.outside import process
from tests.running import until
from trackfield.drivers.session import open_client, open_session, router_settings


def free_endpoint(protocol: str = "tls") -> str:
    """Where nobody listens yet."""
    with socket.socket(type=socket.SOCK_DGRAM if protocol == "quic" else socket.SOCK_STREAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return f"{protocol}/127.0.0.1:{probe.getsockname()[1]}"


@contextmanager
def router_of(security: Security, protocol: str = "tls") -> Iterator[tuple[str, zenoh.Session]]:
    """The router of a secured run in this process: where it listens, and its session."""
    endpoint = free_endpoint(protocol)
    settings = router_settings([endpoint], security.credentials(ROUTER), more=security.settings)
    with open_session(settings) as session:
        yield endpoint, session


def client(endpoint: str, run: str, security: Security, name: str) -> zenoh.Session:
    """A session of the process, or whatever else has this certificate."""
    return open_client(endpoint, run, 10.0, security.credentials(name))


@contextmanager
def router_by_itself(folder: Path, endpoint: str, said: Path) -> Iterator[None]:
    """``trackfield router --secure``."""
    with process("launcher", "router", "--listen", endpoint, "--secure", str(folder), said=said) as router:
        until(lambda: said.read_text().startswith(f"router at {endpoint}"))
        yield
        assert router.poll() is None
        router.send_signal(signal.SIGINT)
        assert router.wait(30) == 0
