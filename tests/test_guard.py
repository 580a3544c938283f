"""The router of a secured run, for real: how large messages may be, whom it refused, and what its launcher hears."""

from __future__ import annotations

import os
import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh
from zenoh.handlers import Callback

from launcher.records import LAUNCHER
from launcher.security.attempts import ASK_S, NOBODY, SECOND, Asking
from launcher.timeline.view import free_port
from tests.hostile import field
from tests.hostile.papers import THIEF, WHY, Papers, Shown, papers
from tests.outside import process
from tests.running import PATIENCE_S, Run, until
from trackfield.drivers.session import Credentials, client_settings, open_session
from trackfield.wire import keys
from trackfield.wire.envelope import LONGEST
from trackfield.wire.registry import MAX_BYTES, PLAIN_BYTES


class Guarded:
    """``trackfield router --secure`` for a run, with sessions of holders of certificates by their names."""

    def __init__(self, certified: Papers, endpoint: str, said: Path) -> None:
        self.papers, self.endpoint, self._said = certified, endpoint, said
        self.run = certified.router["metadata"]["run"]
        self._sessions: list[zenoh.Session] = []

    def said(self) -> list[str]:
        return self._said.read_text().splitlines()

    def open(self, name: str) -> zenoh.Session:
        folder = self.papers.folder
        texts = [(folder / file).read_text() for file in ("authority.pem", f"{name}.pem", f"{name}.key")]
        session = open_session(client_settings(self.endpoint, self.run, 60.0, Credentials(*texts)))
        self._sessions.append(session)
        return session

    def close(self) -> None:
        for session in self._sessions:
            session.close()  # type: ignore[no-untyped-call]


@pytest.fixture
def guarded(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Guarded]:
    certified = papers(field.plan_of(1), tmp_path / "papers")
    endpoint, said = f"{getattr(request, 'param', 'tls')}/127.0.0.1:{free_port()}", tmp_path / "said"
    arguments = ("--listen", endpoint, "--secure", str(certified.folder))
    with process("launcher", "router", *arguments, said=said) as router:
        until(lambda: "router at" in said.read_text())
        guarded = Guarded(certified, endpoint, said)
        yield guarded
        guarded.close()
        assert router.poll() is None
        router.send_signal(signal.SIGINT)
        assert router.wait(PATIENCE_S) == 0


def flushed(session: zenoh.Session) -> None:
    """What it sent has come to the router."""
    list(session.liveliness().get(f"{keys.LAUNCHER}/*", timeout=20))


def attempts(launcher: zenoh.Session) -> dict[str, dict[str, int]]:
    asking = Asking(launcher)
    asking.finish()
    return asking.attempts


@pytest.mark.parametrize(
    ("key", "most"),
    [
        (f"data/field/to/fusion/{THIEF}/doa", PLAIN_BYTES + LONGEST),
        (f"data/field/to/fusion/{THIEF}/own-kind", MAX_BYTES + LONGEST),
        (f"telemetry/{THIEF}/event", 256 * 1024 + 24),
    ],
)
def test_a_message_is_as_large_as_its_receivers_take_it(key: str, most: int, guarded: Guarded) -> None:
    """Its payload and its attachment together."""
    launcher, node = guarded.open(LAUNCHER), guarded.open(THIEF)
    came: list[int] = []
    launcher.declare_subscriber("**", Callback(lambda sample: came.append(len(sample.payload)), indirect=False))
    flushed(launcher)
    for size in (most - 24, most - 23, 1):
        node.put(key, bytes(size), attachment=bytes(24))
    until(lambda: came[-1:] == [1])
    assert came == [most - 24, 1]
    assert attempts(launcher) == {THIEF: {"size": 1}}


def test_a_long_question_is_not_asked(guarded: Guarded) -> None:
    launcher, node = guarded.open(LAUNCHER), guarded.open(THIEF)
    key, asked = keys.asked_by(keys.JOIN, THIEF), list[int]()

    def on_question(query: zenoh.Query) -> None:
        asked.append(len(query.payload or b""))
        query.reply(key, b"")

    launcher.declare_queryable(key, Callback(on_question, indirect=False))
    until(lambda: list(node.get(key, payload=b"?", timeout=1.0)))
    asked.clear()
    for size in (1000, 1001, 1):
        list(node.get(key, payload=bytes(size), attachment=bytes(24), timeout=1.0))
    assert asked == [1000, 1]
    assert attempts(launcher) == {THIEF: {"size": 1}}


def test_a_router_names_each_new_kind_once(guarded: Guarded) -> None:
    launcher, node = guarded.open(LAUNCHER), guarded.open(THIEF)
    for _ in range(3):
        node.put("data/field/to/fusion/n001/doa", b"forged")
        node.delete("data/field/to/fusion/n001/doa")
    flushed(node)
    assert attempts(launcher) == {THIEF: {"delete": 3, "put": 3}}
    until(lambda: len(guarded.said()) == 3)
    assert sorted(guarded.said()[1:]) == [f"attempt: {THIEF}: delete", f"attempt: {THIEF}: put"]


def test_lines_in_a_key_blame_nobody_else(guarded: Guarded) -> None:
    launcher, node = guarded.open(LAUNCHER), guarded.open(THIEF)
    who = "00" * 16 + " on Interface(lo)+CertCommonName(n001)+Transport(Tls)+" + "00" * 16
    where = "2026-11-28T20:10:14.922616Z TRACE  rx-1 ThreadId(08) zenoh::net::routing::interceptor"
    said = f"{where}::access_control: {who} is unauthorized to Put (ingress) on r\n{where}: Msg intercepted!\n"
    node.put(f"data/field/to/\n{said}/n001/doa", b"forged")
    flushed(node)
    assert "n001" not in attempts(launcher)


def test_a_second_session_of_a_certificate_is_told(guarded: Guarded) -> None:
    """But not two of a node with two lives, nor those of guests."""
    launcher = guarded.open(LAUNCHER)
    for name in (THIEF, "n004", "n004", "guest", "guest", "guest"):
        guarded.open(name)
    assert attempts(launcher) == {}
    guarded.open(THIEF)
    until(lambda: attempts(launcher) == {THIEF: {SECOND: 1}})


def test_only_the_launcher_may_ask(guarded: Guarded) -> None:
    launcher, node = guarded.open(LAUNCHER), guarded.open(THIEF)
    assert list(node.get(keys.ATTEMPTS, timeout=1.0)) == []
    node.declare_queryable(keys.ATTEMPTS, lambda query: query.reply(keys.ATTEMPTS, b"\x80"))
    flushed(node)
    assert attempts(launcher) == {THIEF: {"query": 1, "queryable": 1}}


@pytest.mark.parametrize("guarded", ["tls", "quic"], indirect=True)
def test_who_has_no_certificate_of_the_run_is_counted(guarded: Guarded) -> None:
    launcher = guarded.open(LAUNCHER)
    for shown in (Shown.NONE, Shown.EXPIRED):
        with pytest.raises(zenoh.ZError):
            open_session(guarded.papers.settings(shown, guarded.endpoint, guarded.run, 1.0))
    counted = attempts(launcher)
    assert (set(counted), set(counted[NOBODY])) == ({NOBODY}, {WHY[Shown.NONE], WHY[Shown.EXPIRED]})
    until(lambda: f"attempt: {NOBODY}: expired" in guarded.said())


def test_who_connects_without_tls_is_counted_and_who_only_looks_is_not(guarded: Guarded) -> None:
    host, _, port = guarded.endpoint.removeprefix("tls/").rpartition(":")
    launcher = guarded.open(LAUNCHER)
    with socket.create_connection((host, int(port))):
        pass
    with socket.create_connection((host, int(port))) as stranger:
        stranger.sendall(b"GET / HTTP/1.0\r\n\r\n")
        until(lambda: attempts(launcher))
    assert attempts(launcher) == {NOBODY: {"none, no TLS": 1}}


def forge(peer: zenoh.Session) -> None:
    for _ in range(5):
        peer.put("data/field/to/fusion/n001/doa", b"forged")
    flushed(peer)


# --- in a run -----------------------------------------------------------------------------------------------------


def test_what_a_router_told_before_it_was_killed_is_kept(tmp_path: Path) -> None:
    certified = papers(field.plan_of(1), tmp_path / "papers")
    options = ("--secure", "--certificates", str(certified.folder), "--speed", "1")
    run = Run(tmp_path / "run", *field.arguments(1), *options)
    manifest = until(run.manifest)

    run.started()
    with open_session(certified.settings(Shown.NODES, manifest["endpoint"], manifest["run"], 60.0)) as peer:
        forge(peer)
        time.sleep(3 * ASK_S)
        os.kill(run.family()["router"].pid, signal.SIGKILL)
        until(lambda: run.family().get("router"))
        until(peer.info.routers_zid)
        forge(peer)
        code, said = run.finish()
    assert code == 1
    assert run.metrics()["attempts"][THIEF]["put"] == 10, said
    assert "n003" in said
