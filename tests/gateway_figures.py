"""The tables of docs/gateway.md, from runs of the packaged field: ``python -m tests.gateway_figures``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from launcher.record.figures.hops import end_to_end
from launcher.record.metrics import run_metrics
from tests.test_gateway_runs import CAMERA, Done, run

RADIO: Final = ("backbone.model=lognormal_prr", "backbone.radio=wifi11b")
PLACES: Final = ([60, -60], [100, -60], [70, -40], [50, -45], [40, -35])
LOSSY: Final = ("backbone.ack=1", "backbone.extra_loss=0.15", "run.idle_s=60")
AWAY: Final[Mapping[str, Sequence[str]]] = {
    "nothing": (),
    "backbone, 5 to 45 s": ("faults=[{kind='partition', nodes=['base'], medium='backbone', at_s=5, until_s=45}]",),
    "the same, `camera.queue=1`": (
        "faults=[{kind='partition', nodes=['base'], medium='backbone', at_s=5, until_s=45}]",
        "camera.queue=1",
    ),
    "field, 20 to 56 s": ("faults=[{kind='partition', nodes=['base'], medium='field', at_s=20, until_s=56}]",),
    "base restarted, 29 to 31 s": ("faults=[{kind='restart', nodes=['base'], at_s=29, until_s=31}]",),
    "camera control restarted, 29 to 36 s": (
        "faults=[{kind='restart', nodes=['camera-control'], at_s=29, until_s=36}]",
    ),
}


def chain(hops: int, *settings: str) -> Done:
    """The field with so many forwarding nodes; all backbones are of the same radio."""
    places = ",".join(f"[{x},{y}]" for x, y in PLACES[:hops])
    return run(*CAMERA, *RADIO, f"camera.hops=[{places}]", *settings)


def counts(done: Done) -> tuple[int, ...]:
    """Waiting at the end; passed, refused, dropped, unwanted in all lives of the gateway."""
    lives = [done.told(life)[-1][1] for life in done.ledger.diaries if life.split("~")[0] == "base"]
    return (lives[-1][0], *(sum(life[i] for life in lives) for i in range(1, 5)))


def hop_row(hops: int, name: str, *settings: str) -> str:
    """How long items take to camera control, from their first transmission, and how often they were sent."""
    done = chain(hops, *settings)
    came, _ = done.waited()
    took = [1000 * (at_s - sent_s) for sent_s, (at_s, _) in zip(came, done.items(), strict=True)]
    rows = [row for row in (*end_to_end((), done.rows("backbone")), *done.rows("backbone")) if row.kind == "item"]
    each = ", ".join(f"{ms:.0f}" if ms >= 10 else f"{ms:.1f}" for ms in took)
    figures = run_metrics(done.plan, done.ledger, [])["latency_ms"]["hops"].get(str(hops + 1))
    key = f"{figures['p50']:.1f}, {figures['p95']:.1f} (of {figures['n']})" if figures else "none"
    return f"| {name} | {each} | {len(rows)} | {key} |"


def away_row(name: str) -> str:
    """When the fixes came, and what the gateway counted, with somebody away."""
    done = run(*CAMERA, *AWAY[name])
    waiting, passed, _, dropped, unwanted = counts(done)
    when = ", ".join(f"{at_s:.1f}" for at_s, _ in done.items())
    return f"| {name} | {when} | {waiting} | {passed} | {dropped} | {unwanted} |"


def main() -> None:
    """Both tables."""
    print("| hops | each of the four fixes took, ms | items sent | `latency_ms.hops`, p50, p95 |")
    print("| --- | --- | ---: | --- |")
    for hops in (0, 1, 3, 5):
        print(hop_row(hops, f"{hops} forwarding node{'s' * (hops != 1)}"))
    print(hop_row(3, "3, `camera.hop_s=0.1`", "camera.hop_s=0.1"))
    print(hop_row(3, "3, and one frame in seven is lost", *LOSSY))
    print(
        "\n| away | fixes came to camera control at, s | waiting | passed | dropped | unwanted |\n| --- | --- |"
        + " ---: |" * 4
    )
    for name in AWAY:
        print(away_row(name))


if __name__ == "__main__":
    main()
