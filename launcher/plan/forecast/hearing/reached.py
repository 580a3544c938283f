"""Who reaches whom over how many hops, by the links that deliver half of their messages or more."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from launcher.plan.forecast.graph import CARRIES, links_of
from launcher.plan.forecast.ways import groups
from launcher.records import Passing, Plan
from trackfield.errors import ScenarioError
from trackfield.link.fate import FIELD


@dataclass(frozen=True)
class Reached:
    """The links of the graph of those with a radio of the field, both ways, by who is at their one end."""

    near: Mapping[str, tuple[str, ...]]

    @classmethod
    def of(cls, plan: Plan) -> Reached:
        """Those of a plan: links that deliver messages in both directions, as data and acknowledgements go."""
        links = links_of(plan)
        near = defaultdict[str, list[str]](list)
        for src, dst in sorted(links):
            if (dst, src) in links:
                near[src].append(dst)
        return cls({process.id: tuple(near[process.id]) for process in plan.processes if FIELD in process.media})

    def hops(self, root: str) -> Mapping[str, int]:
        """How many hops each process is away from this one, of those that are connected."""
        if root not in self._found:
            self._found[root] = self._searched(root)
        return self._found[root]

    def way(self, src: str, dst: str) -> tuple[tuple[str, str], ...]:
        """The links of a shortest way; empty if there is none."""
        hops, found, at = self.hops(dst), list[tuple[str, str]](), src
        while at != dst and at in hops:
            after = min((one for one in self.near[at]), key=lambda one: (hops[one], one))
            found.append((at, after))
            at = after
        return tuple(found)

    @property
    def apart(self) -> list[list[str]]:
        """The groups of those who reach each other, the largest first."""
        return groups(self.near, ((src, dst) for src, those in self.near.items() for dst in those))

    @cached_property
    def _found(self) -> dict[str, Mapping[str, int]]:
        return {}

    def _searched(self, root: str) -> Mapping[str, int]:
        found, waiting = {root: 0}, deque([root])
        while waiting:
            at = waiting.popleft()
            for one in self.near[at]:
                if one not in found:
                    found[one] = found[at] + 1
                    waiting.append(one)
        return found


def check_clusters(plan: Plan, passing: Passing) -> None:
    """Raise ``ScenarioError`` unless each sensor of a fixed cluster hears the interest of its head by radio."""
    reached = Reached.of(plan)
    for group in passing.clusters:
        head = group[0]
        hops = reached.hops(head)
        far = [id for id in group if hops.get(id, passing.most_hops + 1) > passing.most_hops]
        if far:
            ways = ", ".join(f"{id} by {hops[id]} hops" if id in hops else f"{id} by no way" for id in far)
            what = (
                f"{head}, the head of {len(group)} sensors, is reached in {passing.most_hops} hops not by all ({ways})"
            )
            expected = (
                f"links that deliver at least {CARRIES:.0%} of the messages: more power or range, clusters that are "
                "closer together, or more hops (architecture.most_hops)"
            )
            raise ScenarioError(what, key="link", expected=expected)
