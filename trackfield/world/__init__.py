"""The simulated world: the targets' paths, when each sensor can hear them, and what it then reads.

Nodes import ``path``, ``readings`` and ``acoustic``, which need the standard library only; ``targets``, ``tracks`` and
``windows`` work on arrays and belong to the launcher's side.
"""
