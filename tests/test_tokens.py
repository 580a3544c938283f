"""Which liveliness tokens are there, over Zenoh."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
import zenoh
from zenoh.handlers import Callback

from tests.running import until
from trackfield.drivers.joining.tokens import Tokens, tokens
from trackfield.drivers.session import open_client, open_router

TIMEOUT_S = 30.0
MANY = 600
"""More than Zenoh's own handler of replies takes (256)."""


@pytest.fixture
def endpoint(tmp_path: Path) -> Iterator[str]:
    place = f"unixsock-stream/{tmp_path}/r.sock"
    with open_router(place):
        yield place


def session(endpoint: str) -> zenoh.Session:
    return open_client(endpoint, "run")


def test_who_knows_more_tokens_than_zenoh_queues_is_told_all_of_them(endpoint: str) -> None:
    seen: list[str] = []
    names = sorted(f"live/{n}" for n in range(MANY))
    with session(endpoint) as launcher, session(endpoint) as others:
        seeing = Callback(lambda sample: seen.append(str(sample.key_expr)), indirect=False)
        held = [launcher.liveliness().declare_subscriber("live/**", seeing, history=True)]
        there = [others.liveliness().declare_token(name) for name in names]
        until(lambda: len(seen) == MANY)
        assert tokens(launcher, "live/**", TIMEOUT_S) == Tokens(names, all=True)
        del held, there


def test_a_token_that_is_gone_is_not_told(endpoint: str) -> None:
    with session(endpoint) as asking:
        with session(endpoint) as other:
            held = other.liveliness().declare_token("live/a")
            until(lambda: tokens(asking, "live/*", TIMEOUT_S) == Tokens(["live/a"], all=True))
            del held
        until(lambda: tokens(asking, "live/*", TIMEOUT_S) == Tokens([], all=True))
