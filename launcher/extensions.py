"""What users bring: trackers that are not Trackfield's own, checked and told to the processes that need them."""

from __future__ import annotations

from launcher.records import Plan
from trackfield.errors import ScenarioError
from trackfield.filters.trackers import TRACKERS, make_tracker
from trackfield.plugins import importable
from trackfield.scenario.options import tables
from trackfield.scenario.places import CENTRE
from trackfield.scenario.sections import Fusion


def tracker_places(fusion: Fusion) -> dict[str, str]:
    """Where the fusion centre finds those of its trackers that are not our own, as ``module:attribute`` by name.

    Raises ``ScenarioError`` for an unknown tracker, options that it does not have or that do not fit, and options of
    a name that is neither a tracker nor a variant of one.
    """
    options = tables(fusion.options)
    for name in dict.fromkeys((*fusion.trackers, *options)):
        if name not in fusion.trackers and str(options[name].get("tracker", name)) not in TRACKERS:
            expected = f"a tracker's name ({', '.join(sorted(TRACKERS))}), or tracker = one of them for a variant"
            raise ScenarioError(f"there is no tracker '{name}'", key=f"fusion.options.{name}", expected=expected)
        make_tracker(name, options.get(name))
    kinds = {str(options.get(name, {}).get("tracker", name)) for name in fusion.trackers}
    return {kind: TRACKERS.place(kind) for kind in sorted(kinds - TRACKERS.own.keys())}


def check_importable(plan: Plan) -> None:
    """Raise ``ScenarioError`` for a tracker that the processes of a run cannot import."""
    places = {
        kind: p for life in plan.processes if life.id == CENTRE for kind, p in life.config.get("places", {}).items()
    }
    for kind, place in places.items():
        if not importable(place):
            module, _, attribute = place.partition(":")
            where = "the main program" if module == "__main__" else f"a function ({attribute})"
            what = f"is defined in {where}, where other processes cannot import it"
            expected = "a class at the top of a module of its own; in virtual time (--virtual) it may be anywhere"
            raise ScenarioError(what, key=f"tracker '{kind}'", expected=expected)
