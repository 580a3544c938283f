"""What a user gets wrong about certificates: one message each, and nothing is written or started."""

from __future__ import annotations

from pathlib import Path

import pytest

from launcher.security.options import host_of, hosts_of, is_local
from tests.authorities import root_in
from tests.command_line import Call, trackfield
from tests.test_cli_bad_input import assert_refused, everything

__all__ = ["trackfield"]

RUN = ("run", "spcpf", "--nodes", "4", "--set", "target.steps=2")
BEYOND = "--listen: whoever reaches tcp/0.0.0.0:7447 could join, listen and give orders; expected --secure"
NEEDS = "--listen: tls/127.0.0.1:7447 needs certificates; expected --secure as well, or tcp"


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        ([*RUN, "--secure", "--virtual"], "--secure: in virtual time there is nobody to keep out; expected it without"),
        ([*RUN, "--insecure"], "--insecure: nobody else comes to the run's own router; expected it with --listen"),
        ([*RUN, "--certificates", "c"], "--certificates: without --secure there are none; expected --secure as well"),
        ([*RUN, "--ca", "c"], "--ca: without --secure there are no certificates; expected --secure as well"),
        ([*RUN, "--secure", "--ca", "none"], "none/authority.pem: --ca: cannot be read (No such file"),
        ([*RUN, "--secure", "--certificates", "/proc/no"], "/proc/no: --certificates: cannot be written"),
        (
            [*RUN, "--secure", "--insecure", "--listen", "tls/0.0.0.0:7447"],
            "--insecure: with --secure nobody comes in without a certificate; expected one of the two",
        ),
        (
            [*RUN, "--secure", "--external", "--listen", "tls/127.0.0.1:7447"],
            "--secure: what starts elsewhere needs certificates of this run; expected --certificates DIR as well",
        ),
        (
            [*RUN, "--secure", "--field", "external", "--listen", "tls/127.0.0.1:7447"],
            "--secure: what starts elsewhere needs certificates of this run; expected --certificates DIR as well",
        ),
        (
            [*RUN, "--secure", "--external", "--connect", "tls/127.0.0.1:7447", "--certificates", "new"],
            "--certificates: the router of --connect does not know certificates that are made now; expected a folder",
        ),
        ([*RUN, "--listen", "tcp/0.0.0.0:7447"], BEYOND),
        (["router", "--listen", "tcp/0.0.0.0:7447"], BEYOND),
        (["router", "--listen", "ws/example.org:7447"], "whoever reaches ws/example.org:7447 could join"),
        ([*RUN, "--listen", "tls/127.0.0.1:7447"], NEEDS),
        (["router", "--listen", "tls/127.0.0.1:7447"], NEEDS),
        ([*RUN, "--secure", "--listen", "tcp/127.0.0.1:7447"], "has no certificates; expected one that can be secured"),
        (["router", "--listen", "udp/127.0.0.1:7447", "--secure", "c"], "udp/127.0.0.1:7447 has no certificates"),
        (["router", "--listen", "tls/127.0.0.1:7447", "--secure", "c"], "c/authority.pem: --secure: cannot be read"),
        (
            [*RUN, "--external", "--connect", "tls/127.0.0.1:7447"],
            "--connect: tls/127.0.0.1:7447 needs certificates; expected --secure as well",
        ),
        (["certificates", "spcpf"], "--out"),
        (["certificates", "spcpf", "--out", "c", "--days", "0"], "--days: is 0; expected more than 0, up to 3650"),
        (["certificates", "spcpf", "--out", "c", "--days", "nan"], "--days: is nan; expected more than 0"),
        (["certificates", "spcpf", "--out", "c", "--days", "1e9"], "--days: is 1e+09; expected more than 0"),
        (["certificates", "spcpf", "--out", "c", "--host", "a b"], "--host: 'a b' is no host; expected an address"),
        (["certificates", "spcpf", "--out", "c", "--slices", "0"], "the number of slices: is 0; expected 1 to "),
        (["certificates", "spcpf", "--out", "c", "--ca", "none"], "none/authority.pem: --ca: cannot be read"),
        (["certificates", "spcpf", "--out", "/proc/no"], "/proc/no: --out: cannot be written"),
        (["certificates", "spcpf", "--out", "/dev/null"], "/dev/null: --out: is no folder"),
        (
            [*RUN, "--secure", "--certificates", "/dev/null"],
            "/dev/null/run.json: --certificates: cannot be read (Not a",
        ),
    ],
)
def test_one_message_each(trackfield: Call, tmp_path: Path, arguments: list[str], part: str) -> None:
    assert_refused(trackfield(*arguments), part)
    assert everything(tmp_path) == set()


def test_a_made_folder_goes_with_no_other_authority_and_no_other_run(trackfield: Call, tmp_path: Path) -> None:
    said = trackfield("certificates", *RUN[1:], "--out", "c")
    assert (said.code, said.out) == (0, "")
    root_in(tmp_path / "ca")
    before = everything(tmp_path)
    run = [*RUN, "--secure", "--certificates", "c"]
    assert_refused(trackfield(*run, "--ca", "ca"), "--ca: the certificates are there already")
    assert_refused(trackfield(*run, "--seed", "7"), "c: --certificates: is for zhai-spcpf with seed 1, not")
    assert_refused(trackfield(*run, "--nodes", "9"), "c: --certificates: has no certificate and key of n004, n005")
    assert_refused(trackfield("certificates", "spcpf", "--out", "c"), "c: --out: is not empty")
    assert everything(tmp_path) == before


def test_an_id_that_is_a_name_of_something_else_is_refused(trackfield: Call, tmp_path: Path) -> None:
    (tmp_path / "sensors.csv").write_text("id,x,y\nguest,0,0\nslice-3,50,0\nn2,0,50\nn3,50,50\n")
    said = trackfield("certificates", "spcpf", "--sensors", "sensors.csv", "--out", "c")
    assert said.code == 2
    for id in ("guest", "slice-3"):
        assert f"{id}: cannot be the id of a process in a secured run" in said.err
    assert not (tmp_path / "c").exists()


@pytest.mark.parametrize(
    ("endpoint", "host", "local"),
    [
        ("tcp/127.0.0.1:7447", "127.0.0.1", True),
        ("tcp/127.1.2.3:7447", "127.1.2.3", True),
        ("tls/localhost:7447", "localhost", True),
        ("tls/[::1]:7447", "::1", True),
        ("tls/[fe80::1%eth0]:7447#iface=eth0", "fe80::1", False),
        ("tcp/0.0.0.0:7447", "0.0.0.0", False),
        ("tcp/[::]:7447?prio=1", "::", False),
        ("quic/router.field.example:7447", "router.field.example", False),
        ("tcp/localhost.evil.example:7447", "localhost.evil.example", False),
        ("unixsock-stream//tmp/router.sock", "", True),
    ],
)
def test_which_endpoints_are_of_this_machine_alone(endpoint: str, host: str, local: bool) -> None:
    assert is_local(endpoint) is local
    if not endpoint.startswith("unix"):
        assert host_of(endpoint) == host


def test_a_certificate_names_no_host_for_any_address() -> None:
    assert hosts_of(["tls/0.0.0.0:1", "tls/[::]:1", "tls/10.0.0.7:1"]) == ("10.0.0.7",)
