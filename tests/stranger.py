"""The kind of sensing ``strength`` of docs/extending.md, as a module that others brought, and what tests make of it."""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from trackfield.draw import normal

DOCS: Final = (Path(__file__).parents[1] / "docs" / "extending.md").read_text()
(CODE,) = re.findall(r"`strength\.py`:\n\n```python\n(.*?)```", DOCS, re.DOTALL)
"""The module, as it is printed."""


def _module() -> ModuleType:
    module = ModuleType("strength")
    sys.modules["strength"] = module  # where dataclasses look for it
    exec(CODE, module.__dict__)
    return module


Strength: Any = _module().Strength


@dataclass(frozen=True)
class Walking(Strength):  # type: ignore[misc]
    """Its truth is what it tells trackers: the power walks, by draws of the key ``walk``, a step a second."""

    walk: int = 0

    def power_at(self, t_s: int) -> float:
        """The true power (dBm) at this time."""
        return float(self.power_dbm) + _walked(self.walk, t_s, self.unknowns[0].walk_sd)

    def simulate(self, scene: Any, t_ns: int, place: Any, normals: Any) -> Any:
        now = replace(self, power_dbm=self.power_at(t_ns // 10**9))
        return Strength.simulate(now, scene, t_ns, place, normals)


@lru_cache(maxsize=1000)
def _walked(key: int, t_s: int, sd: float) -> float:
    return sum(sd * normal(key, "walk", k) for k in range(1, t_s + 1))


def walking(seed: int) -> Walking:
    """One whose power at the start is drawn as ``unknowns`` says."""
    (power,) = Strength.unknowns
    return Walking(power_dbm=power.mean + power.sd * normal(seed, "power"), walk=seed)
