"""The world that is sensed: where targets go, who can hear them when, and what a sensor then reads.

Nodes import ``path``, ``readings`` and ``acoustic``, which need the standard library only; ``targets``, ``tracks`` and
``windows`` work on arrays and belong to the launcher's side.
"""
