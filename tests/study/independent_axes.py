"""Axes with known truth, on which the predictions of a study are judged: one per property of real machines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from independent_axis import STEP, Law, Reference, Run, simulate, typical_moves

DURATION = 16.0  # s


@dataclass(frozen=True)
class SimulatedAxis:
    """An axis, its servo, what its user logs and declares, and what a study should say."""

    axis: Mapping[str, float]
    servo: Mapping[str, float]
    """Values of the structs in `independent_axis.c`; the user declares gains, Ts, window, limit, quantum and delay."""
    names: str = ""
    """Regular expression of the words that name the property of this axis in the report; empty if there is none."""
    moves: tuple[float, float, float] = (0.3, 0.6, 3.0)  # stroke, speed, acceleration
    noise: float = 0.0  # standard deviation of the measured position, in addition to the encoder
    current_noise: float = 0.1  # standard deviation of the logged force [N]
    jitter: float = 0.0  # largest error of a time stamp [s]
    actual: bool = False  # whether the log has the force after delay and current loop instead of the command
    unknown: tuple[str, ...] = ()  # parameters without one true value
    declared: bool = False  # whether the user declares filters and friction feedforward of the drive, or the load
    load: float = 0.0  # the load alternates between 0 and this value; logged as a column `normal`
    seed: int = 1

    @property
    def Ts(self) -> float:
        return self.servo.get("Ts", 1e-3)

    @property
    def reference(self) -> Reference:
        return typical_moves(DURATION, self.Ts, *self.moves)

    @property
    def truth(self) -> Mapping[str, float]:
        """Mass, friction and constant force, with the names of the study: totals that a rigid model should have."""
        p = self.axis
        mass, offset = p["m1"] + p.get("m2", 0.0), p.get("weight", 0.0)
        Fc, Fv = (p.get(f"{name}1", 0.0) + p.get(f"{name}2", 0.0) for name in ("Fc", "Fv"))
        own = {"M": mass, "Fc": Fc, "Fv": Fv, "sigma2": Fv, "OF": offset}
        if p.get("vs1"):
            own |= {"Fs": p["Fs1"], "vs": p["vs1"]}
        if p.get("kind1") == 2.0:
            own |= {"sigma0": p["sigma01"], "sigma1": p["sigma11"]}
        return {name: value for name, value in own.items() if name not in self.unknown}

    def run(self, *, law: Law | None = None, step: float = STEP, **changed: float) -> Run:
        """Simulate the servo, with changed values, or an exported law in its place."""
        reference, rng = self.reference, np.random.default_rng(self.seed)
        n = len(reference.r)
        noise = self.noise * rng.standard_normal(n) if self.noise else None
        t = self.Ts * np.arange(float(n))
        load = np.where(t % 5.0 < 2.5, 0.0, self.load) if self.load else None
        return simulate(self.axis, {**self.servo, **changed}, reference, noise=noise, load=load, law=law, step=step)

    def write(self, folder: Path, name: str, *, default: bool = False) -> None:
        """Write ``log.csv`` and ``axis.toml`` as a user would; `default` leaves models and laws to the study."""
        run, reference, rng = self.run(), self.reference, np.random.default_rng(self.seed + 1000)
        n = len(run.x1)
        t = self.Ts * np.arange(float(n)) + rng.uniform(-self.jitter, self.jitter, n)
        force = (run.force if self.actual else run.command) + self.current_noise * rng.standard_normal(n)
        columns = {
            "t": t,
            "pos_act": run.measured,
            "pos_cmd": reference.r,
            "F_drive": force,
        }
        formats = ["%.6f", "%.9f", "%.9f", "%.5f"]
        roles = {
            "time": ("t", "s"),
            "position": ("pos_act", "m"),
            "reference": ("pos_cmd", "m"),
            "force": ("F_drive", "N"),
        }
        if self.load:
            columns["F_normal"] = np.where(self.Ts * np.arange(float(n)) % 5.0 < 2.5, 0.0, self.load)
            formats.append("%.3f")
            if self.declared:
                roles["normal"] = ("F_normal", "N")
        rows = np.column_stack([*columns.values()])
        folder.mkdir(parents=True, exist_ok=True)
        np.savetxt(folder / "log.csv", rows, formats, ",", header=",".join(columns), comments="")
        (folder / "axis.toml").write_text(self._settings(name, roles, default), encoding="utf-8")

    def _settings(self, name: str, roles: Mapping[str, tuple[str, str]], default: bool) -> str:
        s = {"window": 2.0, "delay": 0.0, "quantum": 0.0, "ki": 0.0, **self.servo}
        gains = {"kp": "Kp", "kv": "Kd", "ki": "Ki"} if s.get("pid") else {"kp": "kp", "kv": "kv", "ki": "ki"}
        lines = ["[data]", 'file = "log.csv"', f'name = "{name}"', "", "[columns]"]
        lines += [f'{role} = {{ column = "{column}", unit = "{unit}" }}' for role, (column, unit) in roles.items()]
        lines += ["", "[servo]", f'law = "{"PID" if s.get("pid") else "CascadePPI"}"']
        lines += [f"{shown} = {float(s[key])!r}" for key, shown in gains.items()]
        lines += [f"Ts = {self.Ts!r}", f"force_limit = {float(s['limit'])!r}", f"window = {int(s['window'])}"]
        lines += [f"quantum = {float(s['quantum'])!r}", f"delay = {int(s['delay'])}"]
        if s.get("fed_velocity"):
            lines.append("velocity_feedforward = true")
        if s.get("fed_mass"):
            lines.append(f"inertia_feedforward = {float(s['fed_mass'])!r}")
        if self.declared and s.get("order"):
            lines.append(f"velocity_filter = {{ order = {int(s['order'])}, cutoff = {float(s['corner'])!r} }}")
        if self.declared and s.get("notch"):  # the zeros have a twentieth of the damping of the poles
            own = f"frequency = {float(s['notch'])!r}, damping = {float(s['width'])!r}, depth = 0.05"
            lines.append(f"notch = {{ {own} }}")
        if self.declared and s.get("fed_coulomb"):
            lines.append(f"coulomb_feedforward = {float(s['fed_coulomb'])!r}")
        if not default:
            lines += ["", "[identify]", 'models = ["Stribeck", "LuGre"]', "", "[compensation]"]
            laws = ("StaticFeedforward", "LuGreFeedforward", "DisturbanceObserver", "ExtendedStateObserver")
            lines.append(f"compensators = [{', '.join(f'{law!r}' for law in laws)}]".replace("'", '"'))
        return "\n".join(lines) + "\n"


def dry(Fc: float, Fs: float = 0.0, vs: float = 0.0, Fv: float = 0.0, side: int = 1, **more: float) -> dict[str, float]:
    """Return friction of one side: static, Coulomb and viscous."""
    values = {"Fc": Fc, "Fs": Fs or Fc, "vs": vs, "Fv": Fv, **more}
    return {f"{name}{side}": value for name, value in values.items()}


def lugre(Fc: float, Fs: float, vs: float, Fv: float, sigma0: float, sigma1: float) -> dict[str, float]:
    return dry(Fc, Fs, vs, Fv, kind=2.0, sigma0=sigma0, sigma1=sigma1)


def belt(frequency: float) -> dict[str, float]:
    """Return a motor of 3 kg and a load of 10 kg with this resonance, damped by 1.5 %."""
    reduced, w = 3.0 * 10.0 / 13.0, 2.0 * np.pi * frequency
    own = {"m1": 3.0, "m2": 10.0, "k": reduced * w**2, "c": 2.0 * 0.015 * reduced * w}
    return own | dry(6.0, Fv=10.0) | dry(10.0, Fv=5.0, side=2)


SLIDE = {"m1": 12.0, **dry(18.0, Fv=45.0)}
CASCADE = {"kp": 40.0, "kv": 1500.0, "limit": 400.0, "quantum": 1e-7}
PD = {"pid": 1.0, "kp": 6e4, "kv": 1500.0, "limit": 400.0, "quantum": 1e-7}
SLOW = {"kp": 8.0, "kv": 100.0, "limit": 200.0, "window": 1.0, "quantum": 1e-6}

FRICTION = ("Fc", "Fv", "sigma2", "OF")
RESONANCE = r"resonan|two[- ]mass|TwoMass|elastic"

UNDECLARED: Mapping[str, SimulatedAxis] = {
    "coulomb": SimulatedAxis(SLIDE, CASCADE),
    "stribeck": SimulatedAxis({"m1": 12.0, **dry(18.0, 27.0, 0.01, 45.0)}, CASCADE, r"Stribeck"),
    "lugre_pid": SimulatedAxis(
        {"m1": 12.0, **lugre(18.0, 24.0, 0.01, 45.0, 4e5, 800.0)}, {**PD, "ki": 3e5}, r"LuGre|presliding"
    ),
    "lugre_strengthening": SimulatedAxis(
        {"m1": 12.0, **lugre(18.0, 14.0, 0.02, 45.0, 4e5, 800.0)}, CASCADE, r"no Stribeck effect|strengthen"
    ),
    "maxwell_slip": SimulatedAxis(
        {"m1": 12.0, **dry(18.0, Fv=45.0, kind=3.0, sigma0=6e5)}, PD, r"GMS|presliding|LuGre"
    ),
    "vertical_screw": SimulatedAxis(
        {**SLIDE, "weight": 60.0}, {**CASCADE, "ki": 3e4}, r"gravity|weight|constant force"
    ),
    "swinging_arm": SimulatedAxis(
        {"m1": 12.0, **dry(18.0, Fv=45.0), "swing": 60.0}, CASCADE, r"gravity|force over position", (1.2, 1.5, 5.0)
    ),
    "belt_8_Hz": SimulatedAxis(belt(8.0), SLOW | {"Ts": 4e-3, "quantum": 1e-5, "delay": 1.0}, RESONANCE),
    "belt_25_Hz": SimulatedAxis(belt(25.0), SLOW | {"kp": 15.0, "kv": 250.0}, RESONANCE),
    "belt_60_Hz": SimulatedAxis(belt(60.0), SLOW | {"kp": 25.0, "kv": 500.0}, RESONANCE),
    "backlash": SimulatedAxis(
        {"m1": 4.0, "m2": 8.0, "k": 2e6, "c": 200.0, "gap": 2e-4, **dry(8.0, Fv=25.0), **dry(10.0, Fv=20.0, side=2)},
        CASCADE | {"kv": 1000.0},
        r"backlash|\bplay\b|lost motion",
    ),
    "direction": SimulatedAxis(
        {"m1": 12.0, **dry(14.0, Fv=40.0, back=1.6)}, CASCADE, r"direction|asymmetr", unknown=FRICTION
    ),
    "drifting": SimulatedAxis({**SLIDE, "drift": 0.8, "tau": 6.0}, CASCADE, r"drift|warm|over time", unknown=FRICTION),
    "load_dependent": SimulatedAxis(
        {**SLIDE, "mu1": 0.15}, CASCADE, r"depends on the load|load-dependent|normal", load=80.0, unknown=FRICTION
    ),
    "cogging": SimulatedAxis({**SLIDE, "ripple": 8.0, "pitch": 0.024}, CASCADE, r"cogging"),
    "saturated": SimulatedAxis(SLIDE, CASCADE | {"limit": 48.0}, r"force limit|saturat|at the limit"),
    "velocity_filter": SimulatedAxis(
        SLIDE, CASCADE | {"kv": 900.0, "order": 1.0, "corner": 80.0}, r"velocity filter|low-pass"
    ),
    "notch": SimulatedAxis(SLIDE, CASCADE | {"kv": 900.0, "notch": 120.0, "width": 0.5}, r"notch"),
    "delay_1": SimulatedAxis(SLIDE, CASCADE | {"delay": 1.0}, actual=True),
    "current_loop": SimulatedAxis(SLIDE, CASCADE | {"lag": 1e-3}, r"current loop", actual=True),
    "delay_3": SimulatedAxis(SLIDE, CASCADE | {"kv": 900.0, "kp": 30.0, "delay": 3.0}),
    "drive_with_coulomb": SimulatedAxis(
        SLIDE, CASCADE | {"fed_coulomb": 10.0}, r"friction.feedforward|sgn|Coulomb feedforward"
    ),
    "jitter": SimulatedAxis(SLIDE, CASCADE, r"jitter|time stamps", jitter=1e-4),
    "coarse_encoder": SimulatedAxis(
        SLIDE, CASCADE | {"kp": 20.0, "kv": 400.0, "quantum": 2e-5, "window": 4.0}, r"encoder|coarse", noise=0.0
    ),
    "frictionless": SimulatedAxis({"m1": 12.0, "Fv1": 5.0}, CASCADE, r"no dry friction"),
}
AXES: Mapping[str, SimulatedAxis] = {
    **UNDECLARED,
    "velocity_filter_declared": replace(UNDECLARED["velocity_filter"], declared=True, names=""),
    "notch_declared": replace(UNDECLARED["notch"], declared=True, names=""),
    "load_dependent_declared": replace(UNDECLARED["load_dependent"], declared=True),
    "drive_with_coulomb_declared": replace(UNDECLARED["drive_with_coulomb"], declared=True, names=""),
}
"""Axes by name."""
