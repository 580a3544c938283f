"""Prints the table of docs/security.md: what the router lets each certificate do. ``python -m tests.access_table``"""

from __future__ import annotations

from typing import Any, Final

from launcher.records import LAUNCHER, LIVE, RECORDER, ROUTER
from launcher.security.access import rules
from trackfield.drivers.joining.credentials import GUEST
from trackfield.drivers.spec import ProcessSpec

ID: Final = "ID"
_NAMES: Final = {
    LAUNCHER: "`launcher`",
    RECORDER: "`recorder`",
    LIVE: "`live`",
    ROUTER: "`router`, to see whether it answers",
    ID: "a process, here `ID`, that hears the cell `CELL`",
    GUEST: "`guest`",
    "slice-1": "`slice-1`, here of `ID` alone",
}
_WORDS: Final = {
    "put": "puts",
    "delete": "",
    "declare_subscriber": "subscriptions",
    "query": "questions",
    "reply": "answers",
    "declare_queryable": "offers of answers",
    "liveliness_token": "tokens",
    "liveliness_query": "questions for tokens",
    "declare_liveliness_subscriber": "subscriptions to tokens",
}
_FLOWS: Final = {("ingress",): "from it", ("egress",): "to it", ("ingress", "egress"): "both"}


def table() -> str:
    """In Markdown."""
    life = ProcessSpec(ID, "node", "node.role:Node", cells=("CELL",))
    settings = rules("RUN", [life], [(ID,)])
    by_id = {rule["id"]: rule for rule in settings["rules"]}
    lines = ["| certificate | way | what | at keys, after `RUN/` |", "| --- | --- | --- | --- |"]
    for policy in sorted(settings["policies"], key=lambda policy: list(_NAMES).index(policy["subjects"][0])):
        name = _NAMES[policy["subjects"][0]]
        for rule in (by_id[id] for id in policy["rules"]):
            lines.append(f"| {name} | {' | '.join(_cells(rule))} |")
            name = ""
    return "\n".join(lines)


def _cells(rule: dict[str, Any]) -> tuple[str, str, str]:
    everything = len(rule["messages"]) == len(_WORDS)
    what = "everything" if everything else ", ".join(_WORDS[one] for one in rule["messages"])
    keys = ", ".join(f"`{key.removeprefix('RUN/')}`" for key in rule["key_exprs"])
    return _FLOWS[tuple(rule["flows"])], what, keys


if __name__ == "__main__":
    print(table())
