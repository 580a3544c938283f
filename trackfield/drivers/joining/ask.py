"""Questions of a process to the launcher, and how it tells the launcher's answer from those of others."""

from __future__ import annotations

import time
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any, Final, NamedTuple

import msgpack
import zenoh
from zenoh.handlers import Callback

from trackfield.drivers.exchange.intake import Refusals, printable, unpacked
from trackfield.drivers.exchange.seal import TOKEN, Seal
from trackfield.drivers.joining.tokens import tokens
from trackfield.wire import keys
from trackfield.wire.error import WireError

ANSWER_TIMEOUT_S: Final = 60.0
ASK_TIMEOUT_S: Final = 10.0
"""For one query: if thousands ask at once, a query or its reply may get lost."""
RETRY_S: Final = 0.2
LOOKS: Final = 5
"""How often to look for the launcher's token, which may come a moment after its run is known."""
REFUSED: Final = "refused"
"""The key under which an answer says why there is none."""
UNSEALED: Final = "unsealed"
"""The key of an answer to a question without the run's seal."""


MAX_QUESTION: Final = 1000
"""The longest question (bytes)."""
MAX_WHY: Final = 500
"""Characters of a refusal that are shown."""
STRANGE_S: Final = 5.0
"""So long a question is asked of which all answers lack the run's seal: the launcher may only be away."""


class JoinError(RuntimeError):
    """The launcher has no place for this process, or does not answer."""


class RefusedError(JoinError):
    """The launcher says no, and why."""


class TokenError(JoinError):
    """This process and those that answer do not share a token."""


class Answered(NamedTuple):
    """What the launcher told, and when that came (monotonic clock of this host, ns)."""

    told: dict[str, Any]
    came_ns: int


def ask(session: zenoh.Session, key: str, question: bytes, seal: Seal, refused: Refusals) -> dict[str, Any]:
    """The launcher's answer to this question. Raises ``JoinError`` if it refuses, or does not answer.

    An answer is the launcher's if it has the run's seal; where there are no seals, if it comes from the session that
    the launcher's token names. All others are ``refused``.
    """
    deadline = time.monotonic() + ANSWER_TIMEOUT_S
    launcher = launcher_in(session, seal)
    wrong: list[WireError] = []
    strange_s: float | None = None
    while time.monotonic() < deadline:
        before = len(wrong)
        answered = ask_once(session, key, question, seal, launcher, wrong)
        if answered is not None:
            told = answered.told
            for error in wrong:
                refused.add(key, error)
            if REFUSED in told:
                raise (TokenError if UNSEALED in told else RefusedError)(printable(told[REFUSED], MAX_WHY))
            return told
        if len(wrong) > before and strange_s is None:
            strange_s = time.monotonic() + STRANGE_S
        if seal.token and strange_s is not None and time.monotonic() > strange_s:
            what = f"the answers lack the seal of the token in {TOKEN}"
            raise TokenError(f"{what}: the run was started with another one or without, or somebody pretends to be it")
        time.sleep(RETRY_S)
    raise JoinError("no launcher answers in this run")


def ask_once(
    session: zenoh.Session, key: str, question: bytes, seal: Seal, launcher: str, wrong: list[WireError]
) -> Answered | None:
    """The answer of this ``launcher`` to a question, if one came; what is ``wrong`` with all others."""
    stamp = seal.stamp(_asking(key, question), question)
    came: SimpleQueue[tuple[int, zenoh.Reply] | None] = SimpleQueue()
    # Zenoh's own handler would wake the process ten times a second: too often, if thousands wait.
    handler: Any = Callback(lambda one: came.put((time.monotonic_ns(), one)), lambda: came.put(None), indirect=False)
    answers(session, key, question, ASK_TIMEOUT_S, handler, stamp)
    with suppress(Empty):  # if Zenoh never says that there are no more
        while (one := came.get(timeout=2 * ASK_TIMEOUT_S)) is not None:
            came_ns, answer = one
            if answer.ok is None:
                continue  # Zenoh's own reply where there is no answer in time, or a stranger's
            try:
                return Answered(_checked(answer, key, question, seal, launcher), came_ns)
            except WireError as error:
                wrong.append(error)
    return None


def answers(
    session: zenoh.Session, key: str, question: bytes, timeout_s: float, handler: Any, stamp: bytes | None = None
) -> None:
    """Hand everybody's answers to a question to ``handler``, as they come."""
    session.get(
        key,
        handler,
        payload=question,
        attachment=stamp,
        timeout=timeout_s,
        target=zenoh.QueryTarget.ALL,
        consolidation=zenoh.ConsolidationMode.NONE,
    )


def question_of(query: zenoh.Query, key: str, seal: Seal) -> bytes:
    """What a process of the run asks at this key. Raises ``WireError`` (``key``, ``size``, ``seal``).

    Whoever heard a question can ask it again: it must do no harm.
    """
    question, attachment = query.payload, query.attachment
    if str(query.key_expr) != key:
        raise WireError("key", "a question to many")
    if question is None or not 0 < len(question) <= MAX_QUESTION:
        raise WireError("size", f"a question has up to {MAX_QUESTION} bytes")
    asked = question.to_bytes()
    seal.known(_asking(key, asked), asked, attachment.to_bytes() if attachment else None)
    return asked


def answer(query: zenoh.Query, key: str, told: dict[str, Any], seal: Seal) -> None:
    """Answer a question at this key, as the launcher."""
    payload = msgpack.packb(told)
    about = subject(key, query.payload.to_bytes()[:MAX_QUESTION] if query.payload else b"")
    query.reply(key, payload, attachment=seal.stamp(about, payload))


def subject(key: str, question: bytes) -> str:
    """What the seal of an answer is about: no answer can pass for one to another question."""
    return f"{key}?{question.hex()}"


def _asking(key: str, question: bytes) -> str:
    """What the seal of a question is about: no question can pass for an answer."""
    return f"{key}!{question.hex()}"


def _checked(answer: zenoh.Reply, key: str, question: bytes, seal: Seal, launcher: str) -> dict[str, Any]:
    """The content of an answer. Raises ``WireError`` if it is not the launcher's."""
    sample = answer.ok
    assert sample is not None
    if launcher and session_of(answer) != launcher:
        raise WireError("seal", "not the launcher's answer")
    payload = sample.payload.to_bytes()
    seal.check(subject(key, question), payload, sample.attachment.to_bytes() if sample.attachment else None)
    told = unpacked(payload)
    if type(told) is not dict:
        raise WireError("malformed", "no answer")
    return told


def session_of(answer: zenoh.Reply) -> str:
    """The id of the session that answered."""
    return str(answer.replier_id.zid) if answer.replier_id else ""


def launcher_in(session: zenoh.Session, seal: Seal) -> str:
    """The id of the launcher's session, as its token names it; empty where seals tell its answers from others.

    Raises ``JoinError`` unless there is exactly one.
    """
    if seal.token:
        return ""
    for _ in range(LOOKS):
        sessions = [key.rpartition("/")[2] for key in tokens(session, f"{keys.LAUNCHER}/*", ASK_TIMEOUT_S).keys]
        if len(sessions) > 1:
            raise JoinError(f"{len(sessions)} launchers claim this run: somebody pretends to be one")
        if sessions:
            return sessions[0]
        time.sleep(RETRY_S)
    raise JoinError("no launcher answers in this run")
