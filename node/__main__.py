"""``python -m node``: one sensor node that joins a run through a router."""

from __future__ import annotations

from trackfield.drivers.standalone import main

main("node", "node.role:Node", __doc__)
