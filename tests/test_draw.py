"""Keyed draws: the same for the same key, independent and well distributed for different ones."""

from __future__ import annotations

from hashlib import blake2b
from typing import Final

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest

from trackfield import draw

N: Final = 20_000
SURE: Final = 1e-6
"""A right answer fails a statistical test with this probability, once and for all: draws do not change."""

keys = st.lists(st.integers() | st.text(st.characters(exclude_characters="\x1f", codec="utf-8")), max_size=4)


def test_the_hash_is_the_documented_one() -> None:
    """Pinned, so that a run of one version can be repeated by the next."""
    digest = blake2b(b"7\x1floss\x1fn060\x1f-3", digest_size=8).digest()
    assert draw.bits(7, "loss", "n060", -3) == int.from_bytes(digest, "little")


@given(st.integers(), keys, keys)
def test_equal_keys_and_only_they_are_equal(seed: int, one: list[int | str], other: list[int | str]) -> None:
    same = list(map(str, one)) == list(map(str, other))
    assert (draw.bits(seed, *one) == draw.bits(seed, *other)) == same
    assert draw.bits(seed, *one) != draw.bits(seed + 1, *one)


def test_chunks_do_not_run_together() -> None:
    assert len({draw.bits(1, "ab", "c"), draw.bits(1, "a", "bc"), draw.bits(1, "abc"), draw.bits(11, "c")}) == 4


@pytest.mark.parametrize("extreme", [0, 2**64 - 1])
def test_the_ends_of_the_interval_are_open(extreme: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(draw, "bits", lambda seed, *key: extreme)
    assert 0 < draw.uniform(0) < 1
    assert abs(draw.normal(0)) < 9


def test_uniform() -> None:
    assert kstest([draw.uniform(1, "u", i) for i in range(N)], "uniform").pvalue > SURE


def test_normal() -> None:
    assert kstest([draw.normal(1, "n", i) for i in range(N)], "norm").pvalue > SURE


def test_neighbouring_keys_are_independent() -> None:
    """The sum of two uniform draws of neighbouring steps is triangular, folded to uniform by its own law."""
    pairs = ((draw.uniform(1, i), draw.uniform(1, i + 1)) for i in range(0, 2 * N, 2))
    sums = [u + v for u, v in pairs]
    folded = [s * s / 2 if s < 1 else 1 - (2 - s) ** 2 / 2 for s in sums]
    assert kstest(folded, "uniform").pvalue > SURE
