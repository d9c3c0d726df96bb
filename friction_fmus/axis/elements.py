"""What the closed loop of an axis is made of: plant, compensator, and the reference with its disturbances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from friction_fmus.axis.position_map import PositionMap


@dataclass(frozen=True)
class Plant:
    """Identified mass and friction of an axis."""

    friction: str
    """Friction block."""
    values: Mapping[str, float]
    """Parameters of the friction block; if it has no parameter Fv, this is the coefficient of a viscous friction beside
    it [N.s/m]."""
    mass: float
    """Moved mass [kg]."""
    offset: float = 0.0
    """Constant force that the drive needs in addition to friction [N]."""
    position: PositionMap | None = None
    """Force that depends on position."""

    @property
    def stiffness(self) -> float:
        """Contact stiffness at rest [N/m]; 0 if rigid."""
        elements = sum(value for name, value in self.values.items() if name.startswith("k["))
        return max(self.values.get("sigma0", 0.0), self.values.get("sigma", 0.0), self.values.get("kt", 0.0), elements)


@dataclass(frozen=True)
class Compensator:
    """Compensator in the servo: block, name of its force output, and parameters of the block."""

    model: str
    output: str = "u"
    values: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Trajectory:
    """Reference that the axis follows, its initial state, and disturbances."""

    reference: Path
    """FMU that outputs the reference."""
    samples: int
    """Length in samples of the servo."""
    x0: float
    v0: float
    """Initial position and velocity of the axis [m, m/s]."""
    motion: bool = False
    """Whether the servo receives the reference velocity and acceleration."""
    offset: float = 0.0
    """Constant force added to the output of the servo [N]."""
    rotary: bool = False
    """Whether the axis is rotary."""
    load: float = 0.0
    """Constant force on the axis that the servo does not know [N]."""
    noise: Path | None = None
    """FMU whose output r is noise of standard deviation 1 at the samples of the servo; needed if the position of the
    servo is noisy."""
    injected: NDArray[np.float64] | None = field(default=None, compare=False)
    """Force added to the output of the servo from outside, for a loop without compensator [N]."""
    table: PositionMap | None = None
    """Force over position that is compensated along the reference."""
