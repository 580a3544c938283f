"""docs/wire.md on joining and seals, to the letter: a process that shares no code with Trackfield joins a run."""

from __future__ import annotations

import hashlib
import os
import re
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgpack
import pytest
import zenoh

from tests.running import until
from tests.test_open_registry import SECRET, Run, endpoint
from trackfield.drivers.exchange.seal import Seal, token_from
from trackfield.wire.error import WireError

__all__ = ["endpoint"]
DOCS = (Path(__file__).parents[1] / "docs" / "wire.md").read_text()


def mac(key: bytes, subject: str, number: bytes, payload: bytes) -> bytes:
    text = subject.encode() + b"\0" + number + b"\0" + payload
    return hashlib.blake2b(text, digest_size=16, key=key).digest()


def seal(key: bytes, subject: str, n: int, payload: bytes) -> bytes:
    number = struct.pack("<Q", n)
    return number + mac(key, subject, number, payload)


def asking(session: zenoh.Session, key: bytes) -> Callable[..., dict[str, Any]]:
    """Questions as the document has them; with an empty key, without seals."""

    def ask(where: str, *texts: str) -> dict[str, Any]:
        question = msgpack.packb([*texts, os.urandom(8)])
        stamp = seal(key, f"{where}!{question.hex()}", 1, question) if key else None
        [reply] = session.get(where, payload=question, attachment=stamp)
        assert reply.ok is not None
        payload = reply.ok.payload.to_bytes()
        if key:
            assert reply.ok.attachment is not None
            number, given = struct.unpack("<Q16s", reply.ok.attachment.to_bytes())
            assert seal(key, f"{where}?{question.hex()}", number, payload)[8:] == given
        told: dict[str, Any] = msgpack.unpackb(payload, strict_map_key=False)
        return told

    return ask


@pytest.mark.parametrize("key", [b"", SECRET], ids=["without seals", "with seals"])
def test_a_process_of_another_make_joins(endpoint: str, key: bytes) -> None:
    run = Run(endpoint, key)
    with run.launcher, run.session() as session:
        ask = asking(session, key)
        name = ask("control/claim", "node", "board 7", "n002")["name"]
        joined = ask(f"control/join/{name}", name)
        assert {"run", "process", "start_ns", "stored", "spent", "ticket"} == joined.keys()
        live = f"live/{name}/{joined['ticket']}"
        held = session.liveliness().declare_token(live + (mac(key, live, b"", b"").hex() if key else ""))
        until(lambda: ask(f"control/confirm/{name}", name, joined["ticket"], "board 7") == {"live": True})
        assert run.registry.live == {"n002"}
        assert "refused" in ask(f"control/join/{name}", name)
        held.undeclare()
        until(lambda: not run.registry.live)
    assert not run.alarms.counts


def test_the_seal_that_is_printed() -> None:
    text, run, number, order, where, printed = re.findall(
        r"With the token `(\w+)`, in the run `(\w+)`, the seal with number (\d+) of the order `(\d+)` at `([a-z/]+)` "
        r"is\s+`([0-9a-f]{48})`",
        DOCS,
    )[0]
    stamp = bytes.fromhex(printed)
    key = hashlib.blake2b(f"{text}\0{run}".encode()).digest()
    assert seal(key, where, int(number), order.encode()) == stamp
    ours = Seal(token_from({"TRACKFIELD_TOKEN": text}, run))
    with pytest.raises(WireError):
        ours.check(where, order.encode() + b"0", stamp)
    ours.check(where, order.encode(), stamp)
    with pytest.raises(WireError, match="sent before"):
        ours.check(where, order.encode(), stamp)


def test_the_question_that_is_printed() -> None:
    printed = set(re.findall(r"`control/join/n003[!?]([0-9a-f]+)`", DOCS))
    assert [msgpack.unpackb(bytes.fromhex(one)) for one in printed] == [["n003", bytes(range(1, 9))]]
