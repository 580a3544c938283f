"""A role that starts alone: its own small command line."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = {"launcher", "numpy", "scipy", "pydantic", "typer", "rich", "rerun", "pyarrow"}
ASK_FOR_HELP = """
import runpy, sys
sys.argv = ["{role}", "--help"]
try:
    runpy.run_module("{role}", run_name="__main__")
except SystemExit as end:
    print(end.code, sorted({heavy} & set(sys.modules)))
"""


def python(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("role", ["node", "fusion", "head"])
def test_help_needs_nothing_but_the_role(role: str) -> None:
    done = python("-c", ASK_FOR_HELP.format(role=role, heavy=HEAVY))
    assert f"python -m {role}" in done.stdout
    assert "--connect ENDPOINT" in done.stdout
    assert done.stdout.splitlines()[-1] == "0 []"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((), "--connect"),
        (("master", "--connect", "tcp/127.0.0.1:9"), "invalid choice: 'master' (choose from "),
        (("--connect", "tcp/127.0.0.1:9", "--run", "r", "--id", "n 1"), "'n 1' is not an id"),
        (
            ("--connect", "nonsense", "--run", "r", "--id", "n1"),
            "--connect is 'nonsense'; expected something like tcp/",
        ),
    ],
)
def test_bad_arguments_have_one_message(arguments: tuple[str, ...], says: str) -> None:
    done = python("-m", "node", *arguments)
    assert done.returncode == 2
    assert says in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


@pytest.mark.parametrize(
    ("role", "says"),
    [
        (("herald", "tests.strangers"), "is 'tests.strangers'; expected something like mine.roles:Base"),
        (("herald", "tests.strangers:Heral"), "tests.strangers:Heral cannot be loaded (AttributeError: "),
        (("herald", "nothing.there:Herald"), "nothing.there:Herald cannot be loaded (ModuleNotFoundError: "),
        (("herald",), "the following arguments are required: MODULE:CLASS"),
        (("her ald", "tests.strangers:Herald"), "argument ROLE: is 'her ald'; expected 1 to 32 of A-Z"),
        (("head", "a b=tests.pairs:Tally"), "argument MODULE:CLASS: is 'a b'; expected 1 to 32 of A-Z"),
        (("head", "=tests.pairs:Tally"), "argument MODULE:CLASS: is ''; expected 1 to 32 of A-Z"),
        (("head", "a=tests.pairs"), "argument MODULE:CLASS: is 'a=tests.pairs'; expected something like mine.roles"),
        (("head", "a=tests.pairs:Tally", "tests.pairs:Tally"), "of several roles each needs a name of its own, like "),
        (("head", "a=tests.pairs:Tally", "a=tests.pairs:Tally"), "of several roles each needs a name of its own, "),
        (("head", "a=tests.pairs:Tally", "b=tests.pairs:Tall"), "tests.pairs:Tall cannot be loaded (AttributeError: "),
    ],
)
def test_a_role_of_ones_own_needs_its_class(role: tuple[str, ...], says: str) -> None:
    done = python("-m", "trackfield.drivers.standalone", *role, "--connect", "tcp/127.0.0.1:9")
    assert done.returncode == 2
    assert says in done.stderr
    assert "Traceback" not in done.stderr
