"""A controller drops a loaded axis unless it starts from the present force

A brake that holds a load of 30 N opens at 20 ms, and a controller is enabled, whose integral or estimate starts at 0
or, with `track`, from the load.

In the sample of enable, track is true and u_track is the load. Three poles of the PID controller at w: without
friction, a step F of the load moves a mass m by F t^2/(2 m) exp(-w t), at most 2 F/(m w^2) exp(-2). Friction opposes
the fall by up to Fs and the sample time adds to it; the bounds are those of F less Fs and of F, with 5 %. ResetPID is
the same controller in the fall. With track, the forces balance from the first sample; an error of u_track below Fs
moves the contact only.

Source: Astrom, Hagglund: Advanced PID Control, ISA 2006.
"""

from math import exp, inf, pi
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from _effect import Check, Effect, command_line, small
from _loop import BLACK, BLUE, FS, GREEN, GREY, RED, TS, Array, panels, save
from friction_fmus import build
from harness import CallablePart, FmuPart, Port, System, Wire

LOAD = 30.0  # [N]
TAKEN, STOP = 0.02, 0.3  # when the controller takes over, end [s]
POLE = 2.0 * pi * 10.0  # [rad/s]
KP, KD, KI = 3.0 * POLE**2, 3.0 * POLE, POLE**3
ERRORS = (0.0, 1.0, 5.0)  # of the force that is tracked [N]
PEAK = 2.0 / POLE**2 * exp(-2.0)  # of the fall over the force, 1 kg [m/N]

CONTROLLERS = {
    "PID": ({"Kp": KP, "Kd": KD, "Ki": KI}, RED),
    "CascadePPI": ({"kp": 0.5 * POLE, "kv": KD, "ki": POLE**2}, GREY),
    "ResetPID": ({"Kp": KP, "Kd": KD, "Ki": KI}, GREEN),
    "ImplicitSuperTwisting": ({}, BLACK),
    "ExtendedStateObserver": ({"wc": POLE, "wo": 6.0 * POLE}, BLUE),
}
"""Parameters and colour by law."""


def bounds(force: float) -> tuple[float, float]:
    """Lowest and highest fall under the PID controller after a step of the force [mm]."""
    return 0.95e3 * PEAK * max(force - FS, 0.0), 1.05e3 * PEAK * force


def taken_over(law: str, force: float | None = None) -> tuple[Array, Array]:
    """Time [s] and position [m]; with a force, the law tracks it in its first sample."""

    def opened(t: float, *_: object) -> tuple[float, float, float]:
        on, first = t > TAKEN - 0.5 * TS, abs(t - TAKEN) < 0.5 * TS
        return -LOAD * on, float(on), float(first and force is not None)

    commands = (Port("enable", type="Boolean"), Port("track", type="Boolean"))
    brake = CallablePart("brake", opened, outputs=(Port("load", "N"), *commands), sampled=True)
    models = {"law": law, "mass": "Mass", "friction": "LuGre"}
    wires: list[str | Wire] = [
        *("brake.enable -> law.enable", "brake.track -> law.track", "brake.load -> mass.F_load"),
        *("mass.x -> law.x", "law.u -> mass.F_drive", "mass.v -> friction.v", "friction.F -> mass.F_friction"),
    ]
    measures = law == "ExtendedStateObserver"
    wires.append(Wire("law.u", "law.u_prev", delay=1) if measures else "mass.v -> law.v")
    start = dict.fromkeys(("law.r", "law.rd", "law.rdd"), 0.0) | {"law.u_track": force or 0.0, "law.Ts": TS}
    start |= {f"law.{key}": value for key, value in CONTROLLERS[law][0].items()}
    with TemporaryDirectory() as folder:
        parts = [brake, *(FmuPart(name, build(model, Path(folder))) for name, model in models.items())]
        with System(parts, wires, start) as system:
            result = system.run(stop=STOP, step=TS, master="newton")
    return result["time"].to_numpy(), result["mass.x"].to_numpy()


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the position of the axis after both starts, check the largest movement."""
    figure, (left, right) = panels("A controller takes over an axis that holds 30 N", 1, 2, (9.6, 3.8))
    checks: list[Check] = []
    fall: dict[str, float] = {}
    for law, (_, colour) in CONTROLLERS.items():
        t, x = taken_over(law)
        fall[law] = float(np.abs(x).max())
        left.plot(1e3 * t, 1e3 * x, color=colour, lw=1.4, label=law)
        low, high = bounds(LOAD) if law in ("PID", "ResetPID") else (-inf, inf)
        checks.append(Check(f"{law}: fall", 1e3 * fall[law], "mm", low, high))
        moved = float(np.abs(taken_over(law, LOAD)[1]).max())
        checks.append(small(f"{law}: movement with track", 1e9 * moved, 1.0, "nm"))
    left.set(xlabel="time [ms]", ylabel="position [mm]", title="memory starts at 0")
    left.legend(fontsize=8)

    for error, colour in zip(ERRORS, (BLUE, GREEN, RED), strict=True):
        t, x = taken_over("PID", LOAD - error)
        right.plot(1e3 * t, 1e6 * x, color=colour, lw=1.4, label=f"error of u_track: {error:g} N")
    wrong = 1e3 * float(np.abs(x).max())
    checks.append(Check(f"PID: fall with an error of {error:g} N", wrong, "mm", *bounds(error)))
    right.set(xlabel="time [ms]", ylabel="position [µm]", title="PID with track in the first sample")
    right.legend(fontsize=8)
    save(figure, __file__, folder)
    falls = ", ".join(f"{law} {1e3 * fall[law]:.2f}" for law in CONTROLLERS)
    numbers = f"Falls in mm: {falls}; with track, below 1e-6, or {wrong:.2f} (PID) if u_track is wrong by {error:g} N."
    return Effect(numbers, tuple(checks))


if __name__ == "__main__":
    command_line(main)
