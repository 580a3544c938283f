"""What a container of a field may do on its host, whom it reaches, and what strangers in its network get."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from functools import partial

import pytest

from tests.containers import Field, image, output
from tests.running import until

__all__ = ["image"]

pytestmark = [pytest.mark.engine, pytest.mark.timeout(900)]

REACH = """
import socket, sys
try:
    socket.create_connection((sys.argv[1], int(sys.argv[2])), 5)
except OSError as error:
    print(type(error).__name__)
else:
    print("reached")
"""
BARE = """
import socket, ssl
context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
try:
    context.wrap_socket(socket.create_connection(("router", 7447), 10)).recv(1)
except ssl.SSLError as error:
    print(error.reason)
"""
ROUTER = "tls/router:7447"


@pytest.fixture(scope="module")
def field(image: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Field]:
    one = Field(image, tmp_path_factory.mktemp("runs"), "zhai-spcpf --nodes 4")
    try:
        one.up(node=1, fusion=1)
        [router] = one.hosts("router")
        until(partial(healthy, router))
        yield one
    finally:
        one.down()


def inside(field: Field, service: str, *command: str) -> str:
    """What a command says in the container of a service."""
    [host] = field.hosts(service)
    return output("docker", "exec", host, *command)


def stranger(field: Field, image: str, *command: str, mount: str = "") -> subprocess.CompletedProcess[str]:
    """A container that somebody else starts in the network of the field."""
    network = ["--network", field.network("field"), *([f"--mount={mount}"] if mount else [])]
    started = ["docker", "run", "--rm", *network, f"{image}:node", "python3", *command]
    return subprocess.run(started, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("service", ["router", "node", "fusion"])
def test_it_is_nobody_on_its_host(field: Field, service: str) -> None:
    status = dict(line.split(":", 1) for line in inside(field, service, "cat", "/proc/self/status").splitlines())
    user = field.environment["TRACKFIELD_USER"].partition(":")[0]
    assert set(status["Uid"].split()) == {user}
    assert user != "0"
    assert [int(status[kind], 16) for kind in ("CapEff", "CapPrm", "CapBnd")] == [0, 0, 0]
    assert status["NoNewPrivs"].strip() == "1"
    assert inside(field, service, "sh", "-c", "touch /field/x 2>&1 || touch /tmp/x && ls /tmp/x").endswith("/tmp/x\n")
    assert "Read-only file system" in inside(field, service, "sh", "-c", "touch /field/x /certificates/x 2>&1 || :")


def test_each_has_the_certificates_that_it_needs(field: Field) -> None:
    assert inside(field, "node", "ls", "/certificates").split() == ["authority.pem", "guest.key", "guest.pem"]
    assert "launcher.key" not in inside(field, "router", "ls", "/certificates")


def test_it_reaches_the_router_and_nobody_beyond(field: Field) -> None:
    assert inside(field, "node", "python3", "-c", REACH, "router", "7447") == "reached\n"
    [fusion] = field.hosts("fusion")
    [address] = output(
        "docker", "inspect", "--format", "{{range .NetworkSettings.Networks}}{{.IPAddress}} {{end}}", fusion
    ).split()
    for beyond in ("fusion", address, "192.0.2.1"):
        assert inside(field, "node", "python3", "-c", REACH, beyond, "22") in {
            "gaierror\n",
            "OSError\n",
            "TimeoutError\n",
        }, beyond


def test_the_engine_sees_that_they_are_well(field: Field) -> None:
    for service in ("router", "node", "fusion"):
        [host] = field.hosts(service)
        until(partial(healthy, host))


def healthy(host: str) -> bool:
    return output("docker", "inspect", "--format", "{{.State.Health.Status}}", host) == "healthy\n"


def test_a_stranger_without_a_certificate_gets_nothing(field: Field, image: str) -> None:
    done = stranger(field, image, "-c", BARE)
    assert done.stdout.strip().endswith("CERTIFICATE_REQUIRED"), done


def test_nor_does_one_with_certificates_of_another_run(field: Field, image: str) -> None:
    other = field.certificates.with_name("others")
    output("containers/certificates", str(other), "zhai-spcpf", "--nodes", "4", **field.environment)
    mount = f"type=bind,source={other}/guest,target=/certificates"
    done = stranger(field, image, "-m", "node", "--connect", ROUTER, "--secure", "/certificates", mount=mount)
    assert done.returncode == 1
    assert "certificate" in done.stderr
