"""The links of a run, one for each medium that its processes have: what they are told of them, and what cannot work."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, Final

from trackfield.errors import ScenarioError
from trackfield.link.fate import FIELD
from trackfield.link.models import BURST_S, make_link
from trackfield.link.trace import recording_in, text_in
from trackfield.protocols.collection.piece import KINDS
from trackfield.role import NS
from trackfield.scenario import Scenario
from trackfield.scenario.links import Ethernet, GilbertElliott, LinkSection, Serial, Trace
from trackfield.scenario.links.link import RadioSection
from trackfield.scenario.nearest import suggestion
from trackfield.scenario.sections.camera import EviD30
from trackfield.wire.codec import bare_kinds
from trackfield.wire.registry import kinds
from trackfield.words import quoted

SECTIONS: Final = {FIELD: "link", "backbone": "backbone", "serial": "serial"}
"""The section of each medium."""
_UNSET: Final[Mapping[str, LinkSection]] = {"backbone": Ethernet(), "serial": Serial()}
"""The links of media whose section is left out."""
BAUD: Final = 9600
"""Of the serial line of an EVI-D30."""
MOST_CHANGES: Final = 50_000_000
"""Changes of all links, for minutes of a machine's time."""


def sections_of(scenario: Scenario, media: Iterable[str] = SECTIONS) -> dict[str, LinkSection]:
    """The link of the field, and those of these media."""
    return {medium: section_of(scenario, medium) for medium in dict.fromkeys((FIELD, *media))}


def section_of(scenario: Scenario, medium: str) -> LinkSection:
    """The link of a medium. The line to a camera is as fast as the camera, unless the scenario says otherwise."""
    given: LinkSection | None = getattr(scenario, SECTIONS[medium])
    if given is None and medium == "serial" and isinstance(scenario.camera, EviD30):
        return Serial(baud=BAUD)
    return given or _UNSET[medium]


def plain(section: LinkSection) -> dict[str, Any]:
    """The arguments of a link; the queue belongs to each process, not to the channel."""
    link = section.model_dump(mode="json", exclude_none=True, exclude={"queue"})
    return {**link, "bare": bare_kinds()} if isinstance(section, Serial) else link


def repeated_by_tree(section: LinkSection) -> dict[str, Any]:
    """The arguments of a link with a tree: it sends the tree's messages once each, as the tree itself repeats them.

    Unless the scenario's ``acks`` say otherwise.
    """
    link = plain(section)
    if isinstance(section, RadioSection):
        link["acks"] = {**dict.fromkeys(KINDS, 0), **link.get("acks", {})}
    return link


def queues_of(sections: Mapping[str, LinkSection]) -> dict[str, int]:
    """How many frames may wait for the radio of a medium, where that is set."""
    return {medium: one.queue for medium, one in sections.items() if hasattr(one, "queue")}


def check_links(scenario: Scenario, media: Collection[str] = SECTIONS) -> None:
    """Raise ``ScenarioError`` unless links can be made; the scenario checked all but their files, what these have,
    and ``acks``.

    The kinds of message that users' own roles define are known once these are loaded.
    """
    known = [one.name for one in kinds()]
    for medium, section in sections_of(scenario, media).items():
        link, name = plain(section), SECTIONS[medium]
        wrong = [kind for kind in link.get("acks", {}) if kind not in known]
        if wrong:
            what = f"there is no message {quoted(wrong[0])}{suggestion(wrong[0], known)}"
            raise ScenarioError(what, key=f"{name}.acks", expected=f"names of messages: {', '.join(known)}")
        try:
            make_link(link, scenario.seed)
        except ValueError as error:
            key, _, what = str(error).partition(": ")
            if key not in type(section).model_fields:
                key, what = "file", str(error)
            raise ScenarioError(what, key=f"{name}.{key}") from None


def with_nodes(
    sections: Mapping[str, LinkSection], processes: Iterable[tuple[str, Collection[str]]]
) -> dict[str, LinkSection]:
    """The links, with the nodes that the ``processes`` are in recordings of delivery ratios; each is given as its id
    and its media. The files have been checked.

    Raises ``ScenarioError`` for an id that is not that of a process, and for a recording of too few nodes.
    """
    ids = [(id, media) for id, media in processes]
    return {
        medium: _with_nodes(section, [id for id, media in ids if medium in media], SECTIONS[medium])
        if isinstance(section, Trace)
        else section
        for medium, section in sections.items()
    }


def _with_nodes(section: Trace, ids: list[str], name: str) -> Trace:
    recording = recording_in(text_in(section.file), section.file)
    if recording is None:  # a trace of frames names processes
        return section
    if section.nodes is not None:
        if unknown := [id for id, _ in section.nodes if id not in ids]:
            what = f"there is no process {quoted(unknown[0])}{suggestion(unknown[0], ids)}"
            raise ScenarioError(what, key=f"{name}.nodes", expected="ids of processes")
        return section
    free = iter([node for node in recording.nodes if node not in ids])
    if len(ids) > len(recording.nodes):
        what = f"has {len(recording.nodes)} nodes, and the run has {len(ids)} processes"
        expected = f"at most as many processes, or {name}.nodes, which says who has which links"
        raise ScenarioError(what, file=section.file, key=f"{name}.file", expected=expected)
    nodes = tuple(sorted((id, id if id in recording.nodes else next(free)) for id in ids))
    return section.model_copy(update={"nodes": nodes})


def check_used(scenario: Scenario, media: Collection[str]) -> None:
    """Raise ``ScenarioError`` for a section of a medium that no process has: it would change nothing."""
    for medium, name in SECTIONS.items():
        if medium not in media and getattr(scenario, name) is not None:
            what = f"is given, and no process of architecture {scenario.architecture.kind} has this medium"
            raise ScenarioError(what, key=name, expected="an architecture with processes that do, or no such section")


def check_bursts(sections: Mapping[str, LinkSection], links: int, end_ns: int) -> None:
    """Raise ``ScenarioError`` if links change between good and bad so often that a run never ends: each is followed."""
    for medium, section in sections.items():
        for key, both_s in _dwells(section):
            changes = 2 * end_ns / NS / both_s
            if changes * links > MOST_CHANGES:
                what = f"each of {links} links would change {changes:.3g} times in the run"
                expected = f"at most {MOST_CHANGES} changes in all: longer times"
                raise ScenarioError(what, key=f"{SECTIONS[medium]}.{key}", expected=expected)


def _dwells(section: LinkSection) -> Iterator[tuple[str, float]]:
    """The key that says how long a link is good or bad, and how long (s) it is both, once each."""
    if isinstance(section, GilbertElliott):
        yield "good_s" if section.good_s < section.bad_s else "bad_s", section.good_s + section.bad_s
    if section.burst_loss is not None:
        yield "burst_s", (section.burst_s or BURST_S) / section.burst_loss
