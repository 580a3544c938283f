"""What a router says of what it refuses, read from its log."""

from __future__ import annotations

from collections import Counter

import pytest

from launcher.security.denials import SIZE, STRANGER, UNKNOWN, Denials
from launcher.security.sessions import GRACE_S, REMEMBERED, Sessions

N1, N2, LAUNCHER = (
    "b1a32675bfc050456feb2f41f0101b87",
    "dc03d5b68654c65e501a048d8cedb121",
    "c5676ede2573af60c3861cb600792f9d",
)
NAMES = {N1: "n01", N2: "n02", LAUNCHER: "launcher"}
ACCESS = "zenoh::net::routing::interceptor::access_control"
DROPPED = "zenoh::net::routing::interceptor: Msg intercepted!"


def line(said: str, thread: int = 8, level: str = "TRACE", name: str = "rx-1") -> str:
    return f"2026-11-28T20:10:14.922616Z {level}  {name} ThreadId({thread:02}) {said}\n"


def checked(session: str, what: str, key: str, *, may: bool = False, flow: str = "ingress", thread: int = 8) -> str:
    """As Zenoh 1.10.2 says it."""
    of = f"{session} on Interface(lo)+CertCommonName({NAMES.get(session, 'x')})+Transport(Tls)+{session}"
    return line(f"{ACCESS}: {of} is {'' if may else 'un'}authorized to {what} ({flow}) on {key}", thread)


def caching(session: str, key: str) -> str:
    """The lines of all that a session may do at a key, looked up at its first use."""
    kinds = ("Query", "Reply", "Put", "Delete", "Declare/Undeclare Subscriber", "Liveliness Query")
    found = [line(f"{ACCESS}: ACL (ingress): caching permissions for `{key}` ...")]
    return "".join([*found, *(checked(session, kind, key) for kind in kinds)])


def denied(log: str, piece: int | None = None) -> Counter[tuple[str, str]]:
    denials = Denials(lambda session: NAMES.get(session, ""))
    data = log.encode()
    for at in range(0, len(data), piece or len(data)):
        denials.feed(data[at : at + (piece or len(data))])
    return denials.denied()


SPOOFED = checked(N1, "Put", "r/data/field/to/x/n02/doa") + line(DROPPED)
CACHED = line(f"{ACCESS}: Using cached result: {N1} is unauthorized to Liveliness Token (ingress) on r/live/n02/x")
ALL = (
    caching(N1, "r/data")
    + checked(N1, "Put", "r/data/field/to/x/n01/doa", may=True)
    + SPOOFED
    + checked(N2, "Query", "r/control/claim")
    + line(DROPPED)
    + caching(N1, "r/live/n02/x")
    + CACHED
    + line(DROPPED)
    + checked(N2, "Declare Subscriber", "r/**")
    + line(DROPPED)
    + checked(N1, "Put", "r/data/field/to/x/n01/doa", may=True)
    + line(DROPPED)
)
COUNTED = {
    ("n01", "put"): 1,
    ("n02", "query"): 1,
    ("n01", "liveliness token"): 1,
    ("n02", "subscriber"): 1,
    ("n01", SIZE): 1,
}


@pytest.mark.parametrize("piece", [None, 1, 7, 100, 4096])
def test_what_was_dropped_is_counted_by_certificate_and_kind(piece: int | None) -> None:
    assert denied(ALL, piece) == COUNTED


def test_looking_up_what_a_session_may_do_is_no_attempt() -> None:
    assert not denied(caching(N1, "r/control/stop") + checked(N1, "Put", "r/data/field/to/x/n01/doa", may=True))


def test_what_is_not_handed_on_was_not_tried_by_its_receiver() -> None:
    assert not denied(checked(N1, "Put", "r/telemetry/n02/event", flow="egress") + line(DROPPED))


def test_an_answer_that_comes_too_late_is_no_attempt() -> None:
    """It is dropped, and no rule is looked up for it."""
    asked = checked(N1, "Query", "r/control/join/n01", may=True) + checked(
        N2, "Query", "r/control/join/n01", may=True, flow="egress"
    )
    assert not denied(asked + line(DROPPED, name="net-0", thread=3) + line(DROPPED))
    assert not denied(checked(N1, "Declare Subscriber", "r/data/*/to/n01/**", may=True) + line(DROPPED))


def test_threads_speak_at_the_same_time() -> None:
    one, two = checked(N1, "Put", "r/a", thread=7), checked(N2, "Delete", "r/b", thread=8)
    log = one + two + line(DROPPED, 8) + line(DROPPED, 7)
    assert denied(log) == {("n01", "put"): 1, ("n02", "delete"): 1}


def test_the_lines_of_one_refusal_may_come_in_two_pieces() -> None:
    denials = Denials(lambda session: NAMES.get(session, ""))
    denials.feed(checked(N1, "Put", "r/a").encode())
    denials.feed((checked(N2, "Put", "r/b", may=True, thread=7) + line(DROPPED)).encode())
    assert denials.denied() == {("n01", "put"): 1}


def test_much_may_be_said_between_the_lines_of_one_refusal() -> None:
    """By other threads: this one may have had to wait for the processor."""
    denials = Denials(lambda session: NAMES.get(session, ""))
    denials.feed((checked(N1, "Put", "r/a") + checked(N2, "Put", "r/b", flow="egress", thread=6)).encode())
    for _ in range(100):
        denials.feed(checked(N2, "Put", "r/b", may=True, thread=7).encode())
    denials.feed((line(DROPPED) + line(DROPPED, thread=6)).encode())
    assert denials.denied() == {("n01", "put"): 1}


def test_a_session_whose_name_comes_later_is_named_then() -> None:
    names: dict[str, str] = {}
    denials = Denials(lambda session: names.get(session, ""))
    denials.feed(SPOOFED.encode())
    assert denials.denied() == {(UNKNOWN, "put"): 1}
    names[N1] = "n01"
    assert denials.denied() == {("n01", "put"): 1}


def test_a_certificate_without_rules() -> None:
    said = "did not match any configured ACL subject. Default permission `Deny` will be applied on all messages"
    log = line(f"{ACCESS}: {'ab' * 16} {said}", level="INFO", name="acc-0") + line(DROPPED)
    assert denied(checked(N1, "Put", "r/a", may=True) + log) == {(UNKNOWN, STRANGER): 2}


def test_no_name_is_taken_from_a_key() -> None:
    """One that holds lines of a log: the certificate that is named in them is not blamed."""
    of = f"{'00' * 16} on Interface(lo)+CertCommonName(n02)+Transport(Tls)"
    forged = line(f"{ACCESS}: {of} is unauthorized to Put (ingress) on r/x") + line(DROPPED)
    found = denied(checked(N1, "Put", f"r/data/field/to/x\n{forged}/n01/doa", may=True))
    assert found == {(UNKNOWN, "put"): 1}


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ("peer sent no certificates", "none"),
        ("invalid peer certificate: UnknownIssuer", "of another authority"),
        ("invalid peer certificate: certificate expired: verification time 1795896854 (UNIX), but", "expired"),
        ("received fatal alert: UnknownCA", "of one who refuses the router's"),
        ("received corrupt message of type InvalidContentType", "none, no TLS"),
        ("invalid peer certificate: InvalidPurpose", "invalid"),
        ("Connection reset by peer (os error 104)", None),
        ("tls handshake eof", None),
    ],
)
def test_connections_that_were_refused(said: str, why: str | None) -> None:
    denials = Denials(lambda _: "")
    told = line(
        f"zenoh_link_tls::unicast: {said}. Hint: increase the system open file limit.", level="WARN", name="acc-0"
    )
    denials.feed(told.encode())
    assert denials.handshakes == ({why: 1} if why else {})


# --- sessions -----------------------------------------------------------------------------------------------------


def test_one_after_the_other_is_no_second_session() -> None:
    sessions = Sessions({})
    for i in range(5):
        sessions.came(f"{i}", "n01", i)
        sessions.went(f"{i}", "n01", i + 0.5)
    assert not sessions.so_far()


def test_a_second_session_counts_while_it_is_there_and_when_it_goes_first() -> None:
    sessions = Sessions({})
    sessions.came("a", "n01", 0.0)
    sessions.came("b", "n01", 1.0)
    sessions.came("c", "n02", 1.0)
    assert sessions.so_far() == {"n01": 1}
    sessions.went("b", "n01", 1.5)
    assert sessions.so_far() == {"n01": 1}
    sessions.went("a", "n01", 2.0)
    sessions.went("c", "n02", 2.0)
    assert sessions.so_far() == {"n01": 1}


@pytest.mark.parametrize(("after_s", "counted"), [(GRACE_S - 1, 0), (GRACE_S + 1, 1)])
def test_one_that_takes_the_place_of_a_lost_one_does_not_count(after_s: float, counted: int) -> None:
    sessions = Sessions({})
    sessions.came("a", "n01", 0.0)
    sessions.came("b", "n01", 100.0)
    sessions.went("a", "n01", 100.0 + after_s)
    assert sessions.so_far()["n01"] == counted
    sessions.went("b", "n01", 200.0)
    assert sessions.so_far()["n01"] == counted


def test_some_certificates_may_have_several() -> None:
    sessions = Sessions({"guest": None, "n01": 2})
    for i in range(5):
        sessions.came(f"g{i}", "guest", 0.0)
    for i in range(3):
        sessions.came(f"n{i}", "n01", 0.0)
    assert sessions.so_far() == {"n01": 1}


def test_who_is_gone_is_remembered_for_a_while_and_who_is_there_for_ever() -> None:
    sessions = Sessions({})
    sessions.came("there", "n01", 0.0)
    for i in range(REMEMBERED + 10):
        sessions.came(f"{i}", "n02", 0.0)
        sessions.went(f"{i}", "n02", 0.0)
    assert [sessions.certificate_of(s) for s in ("there", "0", f"{REMEMBERED}")] == ["n01", "", "n02"]


def test_a_session_of_a_moment_has_its_name() -> None:
    sessions = Sessions({})
    sessions.went("a", "n01", 0.0)
    assert sessions.certificate_of("a") == "n01"
    assert not sessions.so_far()
