"""What the router lets each certificate of a run do: Zenoh's access rules. What is not allowed is denied.

Common names are the ids of processes, and a few names that no process may have. Zenoh compares keys as they are on the
wire, with the run's id in front, so that no rule holds in another run. A put or a subscription is allowed if the key
expressions of a rule include its own.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from launcher.records import LAUNCHER, LIVE, RECORDER, ROUTER
from trackfield.drivers.joining.credentials import GUEST
from trackfield.drivers.spec import ProcessSpec
from trackfield.errors import ScenarioError, combined
from trackfield.wire import keys

TOOLS: Final = (LAUNCHER, ROUTER, RECORDER, LIVE, GUEST)
_SLICE: Final = re.compile(r"slice-[0-9]+")

IN, OUT, BOTH = ("ingress",), ("egress",), ("ingress", "egress")
SUBSCRIBE, QUERYABLE = "declare_subscriber", "declare_queryable"
TOKEN, LOOK, WATCH = "liveliness_token", "liveliness_query", "declare_liveliness_subscriber"
MESSAGES: Final = ("put", "delete", SUBSCRIBE, "query", "reply", QUERYABLE, TOKEN, LOOK, WATCH)
"""All that Zenoh's access control tells apart. Ingress is what comes to the router, egress what it hands on."""


@dataclass(frozen=True, slots=True)
class Rule:
    """Messages of these kinds are allowed in these directions, at these key expressions in the run."""

    flows: tuple[str, ...]
    messages: tuple[str, ...]
    keys: tuple[str, ...]

    def told(self, id: str, run: str) -> dict[str, Any]:
        """As Zenoh reads it."""
        where = [key if key.startswith("*/") else f"{run}/{key}" for key in self.keys]
        flows, messages = list(self.flows), list(self.messages)
        return {"id": id, "permission": "allow", "flows": flows, "messages": messages, "key_exprs": where}


_LAUNCHERS: Final = f"{keys.LAUNCHER}/*"
FINDING: Final = (
    Rule(IN, (LOOK, WATCH), (_LAUNCHERS, f"*/{_LAUNCHERS}")),
    Rule(OUT, (TOKEN,), (_LAUNCHERS,)),
)
"""Who does not know the run's id asks for the launchers of all runs, and is told of this one."""
_ORDERS: Final = (keys.ORDERS, f"{keys.ORDERS}/*")
OBEYING: Final = (Rule(BOTH, (SUBSCRIBE,), _ORDERS), Rule(OUT, ("put",), _ORDERS))


def check_ids(ids: Iterable[str]) -> None:
    """Raise ``ScenarioError`` with all ids that are common names of something else."""
    expected = f"another id than {', '.join(TOOLS)} and slice-1, slice-2 ..."
    what = "cannot be the id of a process in a secured run, where its certificate is named so"
    wrong = sorted({id for id in ids if id in TOOLS or _SLICE.fullmatch(id)})
    if wrong:
        raise combined([ScenarioError(what, key=id, expected=expected) for id in wrong])


def rules(run: str, processes: Iterable[ProcessSpec], blocks: Sequence[Collection[str]] = ()) -> dict[str, Any]:
    """Zenoh's ``access_control`` for the certificates of a run with these lives, and of slices with the ids of each.

    Raises ``ScenarioError`` for an id that no process may have.
    """
    cells = _cells(processes)
    check_ids(cells)
    granted = _tools() | {id: _process(id, cells[id]) for id in cells}
    for number, ids in enumerate(blocks, 1):
        granted[keys.slice_name(number)] = _slice(number, {id: cells[id] for id in ids})
    return _settings(run, granted)


def _cells(processes: Iterable[ProcessSpec]) -> dict[str, list[str]]:
    """The key expressions of the broadcasts that each process listens to."""
    found: dict[str, dict[str, None]] = {}
    for life in processes:
        heard = (keys.neighbourhood(medium, cell) for medium in life.media for cell in life.cells_in(medium))
        found.setdefault(life.id, {}).update(dict.fromkeys(heard))
    return {id: list(heard) for id, heard in found.items()}


def _tools() -> dict[str, tuple[Rule, ...]]:
    reading = Rule(BOTH, (SUBSCRIBE,), ("**",)), Rule(OUT, ("put",), ("**",))
    return {
        LAUNCHER: (Rule(BOTH, MESSAGES, ("**",)),),
        RECORDER: (*reading, *_own(RECORDER)),
        LIVE: (*reading, *_own(LIVE)),
        GUEST: (*_asking(keys.CLAIM, keys.SLICE, keys.CLOCK), *FINDING),
        ROUTER: FINDING,  # who has its certificate sees whether it answers
    }


def _own(name: str) -> tuple[Rule, ...]:
    return Rule(IN, ("put",), (f"telemetry/{name}/*",)), Rule(IN, (TOKEN,), (f"live/{name}/**",))


def _asking(*questions: str) -> tuple[Rule, ...]:
    return Rule(IN, ("query",), questions), Rule(OUT, ("reply", QUERYABLE), questions)


def _process(id: str, cells: Sequence[str]) -> tuple[Rule, ...]:
    """What one process may do: speak in its own name, hear what is for it, ask for its own place."""
    lives = id, f"{id}~$*"
    told = tuple(f"telemetry/{life}/*" for life in lives)
    heard = (f"data/*/to/{id}/**", *cells, *(f"telemetry/{life}/final" for life in lives))
    own = [keys.asked_by(question, id) for question in (keys.CLAIM, keys.JOIN, keys.CONFIRM)]
    return (
        Rule(IN, ("put",), (f"data/*/to/*/{id}/*", f"data/*/all/*/{id}/*", *told)),
        Rule(IN, (TOKEN,), tuple(f"live/{life}/*" for life in lives)),
        Rule(BOTH, (SUBSCRIBE,), heard),
        Rule(OUT, ("put",), heard),
        *_asking(*own, keys.CLOCK),
        *OBEYING,
        *FINDING,
    )


def _slice(number: int, cells: Mapping[str, Sequence[str]]) -> tuple[Rule, ...]:
    """What the processes of a slice may do together, and what its router has to know to hand on what they send."""
    together: dict[tuple[tuple[str, ...], tuple[str, ...]], dict[str, None]] = {}
    for id, heard in cells.items():
        for rule in _process(id, heard):
            together.setdefault((rule.flows, rule.messages), {}).update(dict.fromkeys(rule.keys))
    joined = (Rule(flows, messages, tuple(where)) for (flows, messages), where in together.items())
    own = Rule(IN, (TOKEN,), (f"{keys.SLICE}/{number}/**",))
    return (*joined, *_asking(keys.SLICE), own, Rule(OUT, (SUBSCRIBE, QUERYABLE, WATCH), ("**",)))


def _settings(run: str, granted: Mapping[str, Sequence[Rule]]) -> dict[str, Any]:
    """One policy for each common name; rules that several have are told once."""
    ids: dict[Rule, str] = {}
    for rule in (rule for its in granted.values() for rule in its):
        ids.setdefault(rule, f"r{len(ids)}")
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule.told(id, run) for rule, id in ids.items()],
        "subjects": [{"id": name, "cert_common_names": [name]} for name in granted],
        "policies": [{"rules": [ids[rule] for rule in its], "subjects": [name]} for name, its in granted.items()],
    }
