"""Whether runs are the same, as ``--exact`` asks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from launcher.study.compare import differences
from launcher.study.comparison.runs import Compared


@dataclass(frozen=True)
class Exactness:
    """The differences of the other runs from the first one, to within a tolerance in m and m/s."""

    tolerance: float
    differences: tuple[str, ...]

    @property
    def text(self) -> str:
        """The answer, in a sentence."""
        if self.differences:
            return f"not equal to within {self.tolerance:g}"
        return f"equal to within {self.tolerance:g}, and the fate of every frame is the same"

    def plain(self) -> dict[str, Any]:
        """For JSON."""
        return {"tolerance": self.tolerance, "equal": not self.differences, "differences": list(self.differences)}


def exactness(compared: Compared, tolerance: float) -> Exactness:
    """Compare each further run with the first, tracks and frames."""
    first, *others = zip(compared.names, compared.folders, strict=True)
    found = (f"{name}: {what}" for name, folder in others for what in differences(first[1], folder, tolerance))
    return Exactness(tolerance, tuple(found))
