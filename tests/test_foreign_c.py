"""The C of docs/microcontroller.md: compiled, and what needs no Zenoh is run and tried with golden vectors."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from hashlib import blake2b
from pathlib import Path
from typing import Any, Final

import msgpack
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trackfield.drivers.exchange.seal import TOKEN, Seal, token_from

ROOT: Final = Path(__file__).parents[1]
FILES: Final = dict(
    re.findall(r"`([\w.]+)`:\n\n```c\n(.*?)```", (ROOT / "docs" / "microcontroller.md").read_text(), re.DOTALL)
)
WIRE: Final[str] = re.findall(r"```c\n(.*?)```", (ROOT / "docs" / "wire.md").read_text(), re.DOTALL)[0]
SEALED: Final[list[dict[str, str]]] = json.loads((ROOT / "tests" / "golden" / "wire.json").read_text())["sealed"]
KEY: Final = token_from({TOKEN: "abc"}, "demo")

STRICT: Final = ("-Wall", "-Wextra", "-Werror", "-pedantic")
SANE: Final = ("-fsanitize=undefined,address", "-fno-sanitize-recover=all", "-g")
"""What reads or writes where it should not ends the program."""
TRIED: Final = """
#include <stdio.h>
#include <stdlib.h>
#include "process.h"

static size_t unhex(uint8_t **out, const char *digits)
{
    size_t n = 0, size = strlen(digits) / 2;                /* no byte more, so that one too many is noticed */
    unsigned byte;
    *out = malloc(size ? size : 1);
    for (; n < size; n++) {
        sscanf(digits + 2 * n, "%2x", &byte);
        (*out)[n] = (uint8_t)byte;
    }
    return size;
}

static void print(const uint8_t *data, size_t n)
{
    while (n--)
        printf("%02x", *data++);
    printf("\\n");
}

/* Lines of a word and up to five hexadecimal arguments, each behind a dot. */
int main(void)
{
    static char line[2000000], *argument[6];
    while (fgets(line, sizeof line, stdin)) {
        uint8_t *a[6], out[600];
        size_t n[6];
        int count = 0, i;
        int64_t number;
        char *word = strtok(line, " \\n"), text[64];
        while (count < 6 && (argument[count] = strtok(NULL, " \\n"))) {
            n[count] = unhex(&a[count], argument[count] + 1);
            count++;
        }
        if (!strcmp(word, "blake2b")) {                     /* size, key, data */
            blake2b_t b;
            blake2b_begin(&b, a[0][0], a[1], n[1]);
            blake2b_add(&b, a[2], n[2]);
            blake2b_end(&b, out);
            print(out, a[0][0]);
        } else if (!strcmp(word, "key")) {                  /* token, run, each with an end */
            seal_key(out, (char *)a[0], (char *)a[1]);
            print(out, 64);
        } else if (!strcmp(word, "seal")) {                 /* key, seal, at with an end, sort and question, payload */
            uint8_t number_of = a[1][0];
            char sort = n[3] ? (char)a[3][0] : 0;
            encode_seal(out, a[0], number_of, (char *)a[2], sort, a[3] + 1, n[3] ? n[3] - 1 : 0, a[4], n[4]);
            printf("%d ", check_seal(a[1], a[0], (char *)a[2], sort, a[3] + 1, n[3] ? n[3] - 1 : 0, a[4], n[4]));
            print(out, 24);
        } else if (!strcmp(word, "mark")) {
            encode_mark((char *)out, a[0], (char *)a[1]);
            printf("%s\\n", (char *)out);
        } else if (!strcmp(word, "question")) {             /* random bytes, texts with ends */
            print(out, encode_question(out, (const char *const *)(a + 1), count - 1, a[0]));
        } else if (!strcmp(word, "reached")) {
            print(out, encode_reached(out, a[0][0]));
        } else if (!strcmp(word, "final")) {
            print(out, encode_final(out, a[0][0]));
        } else if (!strcmp(word, "find")) {                 /* map, name with an end */
            const uint8_t *found = find(a[0], a[0] + n[0], (char *)a[1]);
            printf("%d\\n", found ? (int)(found - a[0]) : -1);
        } else if (!strcmp(word, "text")) {
            if (get_text(text, sizeof text, n[0] ? a[0] : NULL, a[0] + n[0]))
                print((uint8_t *)text, strlen(text));
            else
                printf("none\\n");
        } else if (!strcmp(word, "number")) {
            printf("%lld\\n", get_number(&number, n[0] ? a[0] : NULL, a[0] + n[0]) ? (long long)number : -1ll);
        } else if (!strcmp(word, "order")) {
            printf("%lld\\n", (long long)decode_order(a[0], n[0]));
        }
        for (i = 0; i < count; i++)
            free(a[i]);
    }
    return 0;
}
"""

Tried = Callable[..., list[str]]


def build(folder: Path, *arguments: str | Path) -> None:
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    for name, code in {**FILES, "wire.h": WIRE}.items():
        (folder / name).write_text(code)
    subprocess.run([compiler, *STRICT, *arguments], check=True, cwd=folder)


@pytest.fixture(scope="module")
def tried(tmp_path_factory: pytest.TempPathFactory) -> Tried:
    """What the functions of process.h make of lines: a word and its arguments each."""
    folder = tmp_path_factory.mktemp("c")
    (folder / "tried.c").write_text(TRIED)
    build(folder, "-std=c99", *SANE, "tried.c", "-o", "tried", "-lm")

    def call(*lines: tuple[str, *tuple[bytes, ...]]) -> list[str]:
        text = "".join(f"{word} {' '.join('.' + data.hex() for data in data)}\n" for word, *data in lines)
        done = subprocess.run([folder / "tried"], input=text, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
        return done.stdout.splitlines()

    return call


def ended(text: str) -> bytes:
    return text.encode() + b"\0"


def test_there_are_two_files() -> None:
    assert FILES.keys() == {"process.h", "plain_node.c"}


def test_the_node_compiles_with_the_prototypes_of_zenoh_pico(tmp_path: Path) -> None:
    build(tmp_path, "-std=c11", "-O2", "-c", "-I", ROOT / "tests" / "pico", "plain_node.c")


def test_blake2b(tried: Tried) -> None:
    data = bytes(range(256)) * 2
    cases = [
        (size, key, n) for size in (16, 64) for key in (b"", b"k" * 64) for n in (0, 1, 127, 128, 129, 256, 300, 512)
    ]
    printed = tried(*(("blake2b", bytes([size]), key, data[:n]) for size, key, n in cases))
    assert printed == [blake2b(data[:n], digest_size=size, key=key).hexdigest() for size, key, n in cases]


def test_seals_are_the_golden_ones(tried: Tried) -> None:
    """And those of Trackfield's own; with a bit changed, none is one."""
    assert tried(("key", ended("abc"), ended("demo"))) == [KEY.hex()]
    lines, expected = [], []
    for vector in SEALED:
        seal, payload = bytes.fromhex(vector["seal"]), bytes.fromhex(vector["payload"])
        rest = vector["subject"].removeprefix(vector["key"])
        asked = rest[:1].encode() + bytes.fromhex(rest[1:])
        Seal(KEY).check(vector["subject"], payload, seal)
        lines.append(("seal", KEY, seal, ended(vector["key"]), asked, payload))
        expected.append(f"1 {vector['seal']}")
        changed = bytes([*seal[:9], seal[9] ^ 1, *seal[10:]])
        lines.append(("seal", KEY, changed, ended(vector["key"]), asked, payload))
        expected.append(f"0 {vector['seal']}")
    assert tried(*lines) == expected
    live = f"live/n003/{'a1' * 24}"
    assert tried(("mark", KEY, ended(live))) == [Seal(KEY).mark(live)]


def test_what_it_tells_is_golden(tried: Tried) -> None:
    golden = {vector["what"]: vector["payload"] for vector in SEALED}
    nonce, ticket = bytes(range(1, 9)), "0123456789abcdef" * 2
    printed = tried(
        ("question", nonce, *map(ended, ("node", "pi4", "n003"))),
        ("question", nonce, ended("n003")),
        ("question", nonce, *map(ended, ("n003", ticket, "pi4"))),
        ("reached", b"\x02"),
        ("final", bytes([60])),
        ("question", nonce),
    )
    assert printed[:5] == [
        golden["a node claims the place n003"],
        golden["it joins"],
        golden["it asks whether it was seen"],
        golden["the same of one that sends final frames"],
        golden["the final record"],
    ]
    assert printed[5] == msgpack.packb([nonce]).hex()


def test_orders_are_decimal(tried: Tried) -> None:
    texts = [b"0", b"5000000000", b"9" * 18, b"", b"-1", b"12a", b"9" * 19, b" 1", bytes(5)]
    assert tried(*(("order", text) for text in texts)) == ["0", "5000000000", "9" * 18, *["-1"] * 6]


PLAIN: Final = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats(width=32)
    | st.floats()
    | st.text(max_size=300)
    | st.binary(max_size=300),
    lambda inner: st.lists(inner, max_size=20) | st.dictionaries(st.text(max_size=8), inner, max_size=20),
    max_leaves=20,
)


@given(st.lists(st.tuples(st.text("abcdefg", min_size=1, max_size=40), PLAIN), min_size=1, max_size=5))
@settings(max_examples=60, deadline=None)
def test_any_map_is_looked_up(tried: Tried, pairs: list[tuple[str, Any]]) -> None:
    """Each of its names, and one that is not there; cut short anywhere it is no map, or has less."""
    plain = dict(pairs)
    packed = msgpack.packb(plain)
    found = tried(*(("find", packed, ended(name)) for name in plain), ("find", packed, ended("h")))
    assert found[-1] == "-1"
    for value, at in zip(plain.values(), found, strict=False):
        assert packed[int(at) :].startswith(msgpack.packb(value))
    last = [*plain][-1]
    cut = range(0, len(packed), max(len(packed) // 50, 1))
    ats = tried(*(("find", packed[:n], ended(last)) for n in cut))
    assert all(at in ("-1", found[-2]) for at in ats)


@given(st.binary(max_size=60))
@settings(max_examples=100, deadline=None)
def test_any_bytes_are_looked_at(tried: Tried, data: bytes) -> None:
    tried(
        ("find", data, b"a\0"),
        ("text", data),
        ("number", data),
        *(("find", b"\x81" + data[n:], b"\0") for n in range(9)),
    )


def test_texts_and_numbers(tried: Tried) -> None:
    values = [0, 127, 128, 255, 65535, 2**32, 2**63 - 1, 2**63, -1, -33, 1.5, None, True, "5", b"5", [5]]
    printed = tried(*(("number", msgpack.packb(value)) for value in values))
    assert printed == ["0", "127", "128", "255", "65535", str(2**32), str(2**63 - 1), *["-1"] * 9]
    texts = ["", "n003", "x" * 31, "x" * 63, "x" * 64, "x" * 300, b"n003", 5, None]
    fits = [text.encode().hex() for text in ("", "n003", "x" * 31, "x" * 63)]
    assert tried(*(("text", msgpack.packb(text)) for text in texts)) == [*fits, *["none"] * 5]
