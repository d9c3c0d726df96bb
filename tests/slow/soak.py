"""Long runs: many steps of a closed loop, and many instances, without growth of memory or drift of time.

python soak.py [STEPS [INSTANCES]]      100 million and 100 000 by default
"""

from __future__ import annotations

import math
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from shell.instance import Instance, load
from shell.selection import COMPOSITES, built

from friction_fmus import build
from harness import FmuPart, System

BLOCKS = ("LuGre", "GMS", "SevenParameter", "PID", "RepetitiveController", "Profile", *COMPOSITES)
MEMORY = 2**20
"""What may come on top: a freed page here and there [bytes]."""


def resident() -> int:
    """Memory of this process [bytes]."""
    pages = Path("/proc/self/statm").read_text(encoding="ascii").split()[1]
    return int(pages) * 4096


def steps(n: int) -> str:
    """A reference, a controller, a mass and LuGre friction in steps of 1 ms: a tenth to warm up, then all."""
    step, frequency, amplitude = 1e-3, 0.7, 0.01
    models = {"reference": "Sine", "pid": "PID", "mass": "Mass", "friction": "LuGre"}
    wires = [f"reference.{name} -> pid.{name}" for name in ("r", "rd", "rdd")]
    wires += ["mass.x -> pid.x", "mass.v -> pid.v", "pid.u -> mass.F_drive"]
    wires += ["mass.v -> friction.v", "friction.F -> mass.F_friction"]
    start = {"reference.amplitude[1]": amplitude, "reference.frequency[1]": frequency, "pid.Ts": step}
    with tempfile.TemporaryDirectory() as folder:
        parts = [FmuPart(name, build(model, folder)) for name, model in models.items()]
        with System(parts, wires, start) as system:
            for count in (n // 10, n):
                before = resident()
                result = system.run(
                    stop=count * step,
                    step=step,
                    master="newton",
                    record=["reference.r", "mass.x"],
                    decimate=count // 10,
                )
            memory = resident() - before
    times = result["time"].to_numpy()
    drift = max(abs(t / (k * (n // 10) * step) - 1.0) for k, t in enumerate(times) if k)
    phase = 2.0 * math.pi * math.fmod(frequency * float(times[-1]), 1.0)
    off = abs(float(result["reference.r"][-1]) - amplitude * math.sin(phase))
    error = abs(float(result["reference.r"][-1] - result["mass.x"][-1]))
    assert memory < MEMORY, f"{memory} bytes more after {n} steps"
    assert drift < 1e-15, f"the time is off by {drift:g} of itself after {n} steps"
    # the phase of the sine is rounded at the size of the time
    assert off < 10.0 * amplitude * 2.0 * math.pi * frequency * n * step * 2.0**-52 + 1e-15, off
    assert error < amplitude, f"the loop is {error} m off"
    return f"{n} steps: {memory / 1024:.0f} kB more, time off by {drift:.1g}, sine off by {off:.1g} m"


def instances(n: int) -> str:
    """Instances made, initialised, stepped, saved and freed: composites, and blocks with much and little memory."""
    with tempfile.TemporaryDirectory() as folder:
        libraries = [load(built(name, folder)) for name in BLOCKS]
        before = 0
        for k in range(n):
            with Instance(libraries[k % len(libraries)]) as made:
                made.initialise()
                made.step(0.0, 1e-3)
                with made.saved():
                    pass
            if k == n // 10:
                before = resident()
        memory = resident() - before
    assert memory < MEMORY, f"{memory} bytes more after {n} instances"
    return f"{n} instances: {memory / 1024:.0f} kB more"


if __name__ == "__main__":
    counts = [int(text) for text in sys.argv[1:]] + [100_000_000, 100_000][len(sys.argv) - 1 :]
    print(steps(counts[0]))
    print(instances(counts[1]))
