"""What gets past a secured router, which is a real one, and what it and those who come to it say of each other."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from threading import Lock
from typing import Any

import pytest
import zenoh

from launcher.plan.prepare import load, planned
from launcher.records import LAUNCHER, RECORDER, Plan
from launcher.security.security import Security, Wanted, made, made_in
from tests.authorities import root_in
from tests.outside import join
from tests.running import until
from tests.secured import client, free_endpoint, router_of
from trackfield.drivers.joining.credentials import GUEST, credentials_in, refusal
from trackfield.drivers.session import Credentials, open_client
from trackfield.wire import keys

QUIET_S = 1.0
"""How long nothing may come of what is refused, after what was sent later has come."""


@pytest.fixture(scope="module")
def plan() -> Plan:
    return planned(load("spcpf", nodes=4, settings=["target.steps=5"]))


@pytest.fixture(scope="module")
def security(plan: Plan) -> Security:
    return made(plan, Wanted())[0]


@dataclass
class Heard:
    """The keys that came, in the order in which they came."""

    keys: list[str] = field(default_factory=list)
    lock: Lock = field(default_factory=Lock)

    def take(self, sample: zenoh.Sample) -> None:
        with self.lock:
            self.keys.append(str(sample.key_expr))


@contextmanager
def field_of(plan: Plan, security: Security, protocol: str = "tls") -> Iterator[tuple[dict[str, zenoh.Session], Heard]]:
    """Sessions of a run by their certificates, and what the recorder hears."""
    heard = Heard()
    with router_of(security, protocol) as (endpoint, _), ExitStack() as stack:
        names = (LAUNCHER, RECORDER, "fusion", "n000", "n001", GUEST)
        opened = (stack.enter_context(client(endpoint, plan.run.run, security, name)) for name in names)
        sessions = dict(zip(names, opened, strict=True))
        for key in (keys.ALL_DATA, keys.ALL_TELEMETRY, keys.ALL_CONTROL):
            sessions[RECORDER].declare_subscriber(key, heard.take)
        time.sleep(QUIET_S / 2)  # until the router knows
        yield sessions, heard


@pytest.mark.parametrize("protocol", ["tls", "quic"])
def test_only_what_is_its_own_gets_past_the_router(protocol: str, plan: Plan, security: Security) -> None:
    forged = [
        keys.unicast("field", "fusion", "n001", "doa"),
        keys.broadcast("field", "c0", "n001", "doa"),
        keys.telemetry("n001", "final"),
        keys.telemetry("n001~1", "final"),
        keys.telemetry(RECORDER, "status"),
        keys.START,
        keys.to_groups(keys.STOP),
        keys.LIFE,
        keys.asked_by(keys.JOIN, "n000"),
        "data/field/to/*/*/doa",
        "**",
    ]
    own = [
        keys.unicast("field", "fusion", "n000", "doa"),
        keys.broadcast("backbone", "c0", "n000", "doa"),
        keys.telemetry("n000", "final"),
        keys.telemetry("n000~3", "event"),
    ]
    with field_of(plan, security, protocol) as (sessions, heard):
        at_n001 = Heard()
        sessions["n001"].declare_subscriber(keys.ALL_DATA, at_n001.take)
        sessions["n001"].declare_subscriber(keys.inbox("field", "fusion"), at_n001.take)
        for key in forged + own:
            sessions["n000"].put(key, b"x")
        for key in own + forged:
            sessions[GUEST].put(key, b"x")
        until(lambda: len(heard.keys) == len(own))
        time.sleep(QUIET_S)
        assert sorted(heard.keys) == sorted(own)
        assert at_n001.keys == []
        sessions[LAUNCHER].put(keys.to_groups(keys.STOP), b"")
        until(lambda: heard.keys[len(own) :] == [keys.to_groups(keys.STOP)])


def test_only_the_launcher_answers_and_is_seen(plan: Plan, security: Security) -> None:
    asked: list[str] = []

    def queryable(name: str) -> Any:
        def answer(query: zenoh.Query) -> None:
            asked.append(name)
            query.reply(str(query.key_expr), name.encode())

        return answer

    def answers(name: str, key: str) -> list[bytes]:
        found = sessions[name].get(key, timeout=3.0, target=zenoh.QueryTarget.ALL)
        return [reply.ok.payload.to_bytes() for reply in found if reply.ok]

    with field_of(plan, security) as (sessions, _):
        for name in ("n001", GUEST, LAUNCHER):
            for key in (keys.CLAIM, *map(keys.asked_by_all, (keys.CLAIM, keys.JOIN, keys.CONFIRM))):
                sessions[name].declare_queryable(key, queryable(name))
            held = sessions[name].liveliness().declare_token(keys.launcher(name))
            mine = sessions[name].liveliness().declare_token(keys.live("n000", name))
            assert held and mine
        until(lambda: answers("n000", keys.asked_by(keys.JOIN, "n000")) == [b"launcher"])
        assert answers(GUEST, keys.CLAIM) == [b"launcher"]
        asked.clear()
        assert answers("n000", keys.asked_by(keys.JOIN, "n001")) == []
        assert answers("n000", keys.asked_by(keys.CLAIM, "n001")) == []
        assert answers("n000", keys.CLAIM) == []  # whose answer has a certificate
        assert answers(GUEST, keys.asked_by(keys.JOIN, "n000")) == [b"guest"]  # its own, which no router sees
        assert asked == [GUEST]
        launchers = sessions["n000"].liveliness().get(keys.launcher("*"), timeout=3.0)
        assert [str(one.ok.key_expr) for one in launchers if one.ok] == [keys.launcher(LAUNCHER)]
        lives = sessions[LAUNCHER].liveliness().get(keys.ALL_LIVE, timeout=3.0)
        assert {str(one.ok.key_expr) for one in lives if one.ok} == {keys.live("n000", LAUNCHER)}


@pytest.mark.parametrize("protocol", ["tls", "quic"])
def test_a_certificate_that_expires_ends_its_link(protocol: str, plan: Plan) -> None:
    security, authority = made(plan, Wanted())
    heard = Heard()
    with router_of(security, protocol) as (endpoint, router), client(endpoint, plan.run.run, security, RECORDER) as all:
        all.declare_subscriber(keys.ALL_TELEMETRY, heard.take)
        soon = authority.issue("n000", datetime.now(UTC) + timedelta(seconds=12))
        with open_client(endpoint, plan.run.run, 5.0, soon) as brief:
            until(lambda: "n000" in names_at(router))
            until(lambda: brief.put(keys.telemetry("n000", "final"), b"x") or heard.keys)
            until(lambda: "n000" not in names_at(router))
            assert datetime.now(UTC) >= soon_ends(soon)
            count = len(heard.keys)
            brief.put(keys.telemetry("n000", "final"), b"x", congestion_control=zenoh.CongestionControl.DROP)
            with pytest.raises(zenoh.ZError):
                open_client(endpoint, plan.run.run, 2.0, soon)
            assert len(heard.keys) == count
        if protocol == "tls":
            assert refusal(endpoint, soon) == "the router refuses the certificate of this process (certificate expired)"


def names_at(router: zenoh.Session) -> set[str]:
    return {link.auth_identifier or "" for link in router.info.links()}


def soon_ends(credentials: Credentials) -> datetime:
    from cryptography import x509

    return x509.load_pem_x509_certificate(credentials.certificate.encode()).not_valid_after_utc


# --- whoever has no certificate of this run ---------------------------------------------------------------------------


UNKNOWN = "the router refuses the certificate of this process (unknown ca)"
NOT_OURS = (
    "the router's certificate is not what the authority in authority.pem says (unable to get local issuer certificate)"
)


def test_those_of_other_runs_and_authorities_are_refused_and_told_why(plan: Plan, tmp_path: Path) -> None:
    root = root_in(tmp_path / "ca").cert_pem.bytes().decode()
    ours, theirs, forged = (tmp_path / name for name in ("ours", "theirs", "forged"))
    security = made_in(ours, plan, Wanted(ca=tmp_path / "ca"))
    made_in(theirs, planned(load("spcpf", nodes=4, settings=["target.steps=5"])), Wanted(ca=tmp_path / "ca"))
    made_in(forged, plan, Wanted())
    with router_of(security) as (endpoint, _):

        def why(folder: Path, trusting: str = "") -> str:
            found = credentials_in(folder, GUEST)
            shown = Credentials(trusting or found.authority, found.certificate, found.key)
            try:
                open_client(endpoint, None, 2.0, shown).close()  # type: ignore[no-untyped-call]
            except zenoh.ZError:
                return refusal(endpoint, shown)
            return "came in"

        assert why(ours) == why(ours, root) == "came in"  # the router's chain leads to the root
        assert why(theirs) == why(forged) == NOT_OURS
        known = (ours / "authority.pem").read_text()
        assert why(theirs, known) == why(theirs, root) == UNKNOWN
        assert why(forged, known) == UNKNOWN.replace("unknown ca", "decrypt error")  # the right name, the wrong key
        with pytest.raises(zenoh.ZError):
            open_client(endpoint, None, 2.0)
        code, said = join("--connect", endpoint, "--secure", str(theirs))
        assert (code, said) == (1, f"node: cannot join the run through {endpoint}: {NOT_OURS}\n")
        code, said = join("--connect", endpoint, "--secure", str(ours / "guest"))
        assert (code, said) == (1, f"node: cannot join the run through {endpoint}: there is no run yet\n")


def test_a_router_that_is_no_router_of_this_run_is_not_trusted(plan: Plan) -> None:
    """A process cannot pass for the router: its certificate names no host."""
    security, _ = made(plan, Wanted())
    false = Security(lambda _: security.credentials("n001"), security.settings)
    with router_of(false) as (endpoint, _):
        shown = security.credentials("n000")
        with pytest.raises(zenoh.ZError):
            open_client(endpoint, plan.run.run, 2.0, shown)
        assert "the router's certificate is not what" in refusal(endpoint, shown)


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["--secure", "none"], "none/authority.pem: --secure: cannot be read (No such file or directory); expected a"),
        (["--secure", "/dev"], "/dev/authority.pem: --secure: cannot be read"),
        ([], "--secure DIR goes with --connect to tls/... or quic/..."),
    ],
)
def test_a_process_without_certificates_says_so(arguments: list[str], part: str) -> None:
    code, said = join("--connect", free_endpoint(), *arguments)
    assert code == 2
    assert said.startswith("usage: ")
    assert part in said
    assert said.count("error: ") == 1


def test_a_folder_without_a_plain_key_is_refused(plan: Plan, tmp_path: Path) -> None:
    made_in(tmp_path / "c", plan, Wanted())
    (tmp_path / "c" / "guest.key").write_text("nonsense")
    code, said = join("--connect", free_endpoint(), "--secure", str(tmp_path / "c"))
    assert code == 2
    assert "guest.key: --secure: is no PEM of that" in said
