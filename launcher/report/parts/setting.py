"""What was run: the scenario in a line, what was changed in it, and its most important keys."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from launcher.nested import flat
from launcher.record.words import span
from launcher.report.folder import Run
from launcher.report.style import Figures
from trackfield.errors import ScenarioError
from trackfield.scenario import Scenario, names, summary
from trackfield.scenario.keys import sections_of_file
from trackfield.world.path import Path as Way

FIGURES: Final[Figures] = {}
HOW: Final = {"processes": "processes", "virtual": "virtual time", "replay": "replay of recorded reports"}
_MOST_CHANGES: Final = 8
_FILES: Final = (".file", ".recording", ".sound")
"""What the keys of files end with."""
_LONGEST: Final = 60
"""Characters of a changed value that are shown."""


def contents(run: Run) -> dict[str, Any]:
    """See ``Part``."""
    packaged = run.scenario.name in names()
    return {
        "summary": summary(run.scenario.name) if packaged else "",
        "changed": changed(run) if packaged else [],
        "facts": facts(run),
    }


# --- the scenario -----------------------------------------------------------------------------------------------------


def changed(run: Run) -> list[str]:
    """What differs from the packaged scenario of the same name, as ``key = value``, without the seed.

    Of a section of another kind, that, and what differs from the defaults of that kind.
    """
    own = flat(run.scenario.plain())
    try:
        packaged, kinds = _packaged(run.scenario.name, own)
    except ScenarioError:  # of another version of the program
        return []
    differ = (key for key in (*own, *packaged) if not _same(run, key, own.get(key), packaged.get(key)))
    keys = list(dict.fromkeys((*kinds, *differ)))
    own |= {key: Path(str(value)).name for key, value in own.items() if key.endswith(_FILES)}
    said = [f"{key} = {_short(own[key])}" if key in own else f"{key} unset" for key in keys if key != "seed"]
    return said[:_MOST_CHANGES] + ([f"{len(said) - _MOST_CHANGES} more"] if len(said) > _MOST_CHANGES else [])


def _packaged(name: str, own: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """A packaged scenario with sections of the kinds of another one, as far as it can have them, and their keys.

    Raises ``ScenarioError`` if there is none of this name.
    """
    packaged = flat(Scenario.load(name).plain())
    tags = (f"{section}.{one.tag}" for section, one in sections_of_file().items() if one.tag and not one.many)
    kinds = {tag: own[tag] for tag in tags if tag in own and own[tag] != packaged.get(tag)}
    try:
        return flat(Scenario.load(name, kinds).plain()), list(kinds)
    except ScenarioError:  # such a kind needs more than itself, like the file of a target
        return packaged, []


def _same(run: Run, key: str, own: Any, packaged: Any) -> bool:
    """Whether two values are the same; files are compared by content, as the run has its own copy."""
    if key.endswith(_FILES) and own and packaged:
        files = run.folder / Path(str(own)).name, Path(str(packaged))
        return all(file.is_file() for file in files) and files[0].read_bytes() == files[1].read_bytes()
    return bool(own == packaged)


def _short(value: Any) -> str:
    if isinstance(value, list) and value and all(isinstance(one, Mapping) for one in value):
        text = ", ".join(str(one.get("kind", one.get("id", "one"))) for one in value)  # faults, targets
    else:
        text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 4]} ..."


# --- its most important keys ------------------------------------------------------------------------------------------


def facts(run: Run) -> list[tuple[str, str]]:
    """(name, value) of what a reader needs to understand the figures."""
    metrics, fusion = run.metrics, run.scenario.fusion
    setup = f", after {span(run.origin_s)} of setup" if run.origin_s else ""
    return [
        ("sensors", _sensors(run)),
        ("sensing", _sensing(run)),
        *((f"target{f' {id}' if run.several else ''}", _target(path)) for id, path in run.site.paths.items()),
        ("steps", f"{run.site.steps:,} of {run.step_s:g} s each{setup}"),
        ("link", _link(run)),
        ("deadline", f"{span(fusion.deadline_s)} after each step"),
        ("track starts", "around the true state (prior)" if fusion.prior == "paper" else "from the first reports"),
        ("driver", _driver(run)),
        *((f"in the place of {id}", f"a real device, {device}") for id, device in run.manifest.bridges.items()),
        ("seed", str(metrics["seed"])),
        ("started", run.manifest.when),
    ]


def _sensors(run: Run) -> str:
    layout = run.scenario.field
    spacing = getattr(layout, "spacing_m", None)
    apart = f", {spacing:g} m apart" if spacing and len(run.site.sensors) > 1 else ""
    return f"{len(run.site.sensors):,}, layout {layout.layout}{apart}"


def _sensing(run: Run) -> str:
    """What the sensors measure, kind by kind."""
    return "; ".join(_kind(run, name) for name in run.site.sections)


def _kind(run: Run, name: str) -> str:
    section, count = run.site.sections[name], len(run.site.kinds[name])
    kind = section.sensing
    far = f"within {kind.report_m:,.0f} m" if kind.report_m < 1e6 else "any distance"
    if kind.recorded:
        far = "at recorded times" if section.play == "times" else "as recorded"
    adaptive = ", adaptive threshold" if kind.adaptive else ""
    many = f"{count:,} of them " if len(run.site.sections) > 1 else ""
    return f"{many}{kind.summary}, {'up to ' * kind.adaptive}{far}{adaptive}"


def _target(path: Way) -> str:
    """How far and how fast the target went, as far as that is known."""
    moved = np.hypot(*np.diff([path.x, path.y], axis=1))
    there_s, way_m = path.end_s - path.start_s, float(moved.sum())
    far = f"{way_m / 1000:.1f} km" if way_m >= 3000 else f"{way_m:,.0f} m"
    return f"{far} in {span(there_s)}, {way_m / there_s:.1f} m/s on average" if there_s else "at one place"


def _link(run: Run) -> str:
    link = run.scenario.link
    radio = getattr(link, "radio", None)
    parts = [link.model, *([f"radio {radio}"] if radio else [])]
    if spreading := getattr(link, "sf", None):
        parts.append(f"sf {spreading}")
    return ", ".join(parts)


def _driver(run: Run) -> str:
    speed = run.metrics["timing"]["speed"]
    return HOW[run.metrics["driver"]] + ("" if speed in (None, 1) else f", {speed:g} times as fast")
