"""Questions of a process to the launcher, and how it tells the launcher's answer from those of others."""

from __future__ import annotations

import time
from typing import Any, Final

import msgpack
import zenoh

from trackfield.drivers.intake import Refusals, unpacked
from trackfield.drivers.seal import Seal
from trackfield.wire import keys
from trackfield.wire.error import WireError

ANSWER_TIMEOUT_S: Final = 60.0
ASK_TIMEOUT_S: Final = 10.0
"""For one query: if thousands ask at once, a query or its reply may get lost."""
RETRY_S: Final = 0.2
REFUSED: Final = "refused"
"""The key under which an answer says why there is none."""


class JoinError(RuntimeError):
    """The launcher has no place for this process, or does not answer."""


def ask(session: zenoh.Session, key: str, question: bytes, seal: Seal, refused: Refusals) -> dict[str, Any]:
    """The launcher's answer to this question. Raises ``JoinError`` if it refuses, or does not answer.

    An answer is the launcher's if it has the run's seal; where there are no seals, if it comes from the session that
    the launcher's token names. All others are ``refused``.
    """
    deadline = time.monotonic() + ANSWER_TIMEOUT_S
    launcher = "" if seal.token else _launcher(session)
    while time.monotonic() < deadline:
        for answer in answers(session, key, question, ASK_TIMEOUT_S):
            if answer.ok is None:
                continue  # Zenoh's own reply where there is no answer in time, or a stranger's
            try:
                told = _checked(answer, key, question, seal, launcher)
            except WireError as error:
                refused.add(key, error)
                continue
            if REFUSED in told:
                raise JoinError(str(told[REFUSED]))
            return told
        time.sleep(RETRY_S)
    raise JoinError("no launcher answers in this run")


def answers(session: zenoh.Session, key: str, question: bytes, timeout_s: float, handler: Any = None) -> Any:
    """Everybody's answers to a question, as they come, or to ``handler``."""
    everybody = zenoh.QueryTarget.ALL
    each = zenoh.ConsolidationMode.NONE
    return session.get(key, handler, payload=question, timeout=timeout_s, target=everybody, consolidation=each)


def answer(query: zenoh.Query, told: dict[str, Any], seal: Seal) -> None:
    """Answer a question, as the launcher."""
    payload = msgpack.packb(told)
    about = subject(str(query.key_expr), query.payload.to_bytes() if query.payload else b"")
    query.reply(query.key_expr, payload, attachment=seal.stamp(about, payload))


def subject(key: str, question: bytes) -> str:
    """What the seal of an answer is about: no answer can pass for one to another question."""
    return f"{key}?{question.hex()}"


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


def _launcher(session: zenoh.Session) -> str:
    """The id of the launcher's session, as its token names it. Raises ``JoinError`` unless there is exactly one."""
    found = session.liveliness().get(f"{keys.LAUNCHER}/*", timeout=ASK_TIMEOUT_S)
    sessions = sorted(str(token.ok.key_expr).rpartition("/")[2] for token in found if token.ok)
    if not sessions:
        raise JoinError("no launcher answers in this run")
    if len(sessions) > 1:
        raise JoinError(f"{len(sessions)} launchers claim this run: somebody pretends to be one")
    return sessions[0]
