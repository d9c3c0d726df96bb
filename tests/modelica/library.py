"""The Modelica library in rumoca, a Modelica compiler that shares no code with this project."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import rumoca
from numpy.typing import NDArray

Array = NDArray[np.float64]

STUB = Path(__file__).parent / "msl"


def literal(value: Any) -> str:
    """Return a value as Modelica."""
    if isinstance(value, (list, tuple)):
        return "{" + ", ".join(map(literal, value)) + "}"
    return str(value).lower() if isinstance(value, bool) else repr(value)


def given(values: Mapping[str, Any]) -> str:
    """Return modifiers."""
    return ", ".join(f"{name} = {literal(value)}" for name, value in values.items())


def line(nodes: Sequence[float], values: Sequence[float]) -> str:
    """Return lines between nodes as an expression in time, which is exactly 0 where they rest."""
    text = ""
    for (t, v), (until, end) in pairwise(zip(nodes, values, strict=True)):
        text += f"if time < {until!r} then ({v!r}) + ({(end - v) / (until - t)!r})*(time - {t!r}) else "
    return f"({text}({values[-1]!r}))"


SHORT_STEPS = """  Real p(start = 1, fixed = true), q(start = 0, fixed = true);
equation
  der(p) = 211*q;
  der(q) = -211*p;
"""
"""An oscillator beside the system: at rest and after an event, a step else passes over many changes of an input."""


SECONDS = 20.0  # most for a simulation


class Library:
    """The library and the stub of the Modelica Standard Library."""

    def __init__(self, folder: Path) -> None:
        """Take the folder into which it was written."""
        self.roots = [str(folder), str(STUB)]

    def model(self, text: str, name: str = "Test") -> Any:
        """Compile a model."""
        return rumoca.Session(roots=self.roots).loads(text, model=name)

    def run(self, text: str, stop: float, interval: float, tolerance: float = 1e-9, smallest: float = 1e-3) -> Any:
        """Compile and simulate the model `Test`; below `smallest`, the tolerance is absolute."""
        config = rumoca.SimConfig(rtol=tolerance, atol=tolerance * smallest, dt=interval, max_wall_seconds=SECONDS)
        return self.model(text).simulate(stop, config=config)

    def prescribed(
        self, law: str, nodes: Array, v: Array, values: Mapping[str, Any], inputs: Mapping[str, Array], interval: float
    ) -> tuple[Array, Array]:
        """Return times and friction of a law over a prescribed velocity."""
        used = "".join(f", use{name} = true" for name in inputs)
        used += ", " + given(values) if values else ""
        equations = "".join(f"  law.{name} = {line(nodes.tolist(), u.tolist())};\n" for name, u in inputs.items())
        text = f"model Test\n  model Law\n    extends FrictionFMUs.Laws.{law};\n  end Law;\n"
        text += f"  Law law(v = {line(nodes.tolist(), v.tolist())}{used});\n{SHORT_STEPS}{equations}end Test;"
        result = self.run(text, float(nodes[-1]), interval)
        return np.array(result.time), np.array(result["law.F"])
