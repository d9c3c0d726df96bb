"""Without an integral, an axis can stop up to Fs/Kp from its target

A PD controller is a spring and a damper to the target. At rest, friction holds the axis against the spring with up to
Fs. Left: the target moves away slowly and stops, just before and just after break-away. Right: the error that remains
over the distance of the target, for a rigid contact and for LuGre, which breaks away earlier if the target jumps.

The axis is 1 kg with Kp = 3 N/m and Kd = 6 N s/m, the gains of the 1995 paper without the integral, so Fs/Kp is half a
metre. On the left the target moves at 10 mm/s: at 0.95 Fs/Kp the axis has yielded by some 70 µm in its presliding
range, at 1.05 Fs/Kp it has broken away. A rigid contact (KarnoppMass) breaks away at Fs/Kp, even if the target jumps.
If the target jumps on LuGre, the axis oscillates in its presliding range at more than the Stribeck velocity, static
friction falls on the way, and the axis breaks away at targets from 0.7 Fs/Kp on, little more than Fc/Kp. The bound of
the error is Fs/Kp for all.

The distances and errors on LuGre were computed independently, with a Runge-Kutta method at 5 µs from sample to sample.

Source: Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994.
"""

from collections.abc import Mapping
from pathlib import Path

from _effect import Check, Effect, command_line, near
from _loop import BLACK, BLUE, FS, GREEN, GREY, OMEGA, RED, TS, Array, panels, run, save, simulate

KP, KD = 3.0, 6.0  # [N/m], [N s/m]
SPEED, SETTLING = 0.01, 20.0  # of the target that moves [m/s], how long it is waited for the axis then [s]

# Goal as a share of Fs/Kp -> way of the axis [m]
MOVED: Mapping[float, float] = {0.6: 15.014e-6, 0.9: 42.049e-6, 0.95: 68.759e-6, 1.05: 0.187073, 2.0: 0.666671}
JUMPED: Mapping[float, float] = {0.3: 6.197e-6, 0.55: 22.319e-6, 0.7: 0.0120731, 0.95: 0.137073, 2.0: 0.662073}
SERVO: Mapping[float, float] = {5e-6: 1.0829e-6, 50e-6: 16.686e-6, 0.5e-3: 462.36e-6, 5e-3: 4.97547e-3}  # by target [m]
RIGID = (0.3, 0.7, 0.999, 1.05, 2.0)


def lugre(
    target: float, *, jump: bool, Kp: float = KP, Kd: float = KD, settling: float = SETTLING
) -> tuple[Array, Array]:
    """Time and position of the axis with LuGre friction."""
    gains = {"Kp": Kp, "Ki": 0.0, "Kd": Kd, "m": 0.0}
    if jump:
        start = {"reference.offset": target, "reference.amplitude[1]": 0.0}
        result = run("Sine", {"x": ("r", "rd", "rdd")}, settling, start, gains=gains)
    else:
        start = {"reference.r_end": target, "reference.v_max": SPEED, "reference.a_max": 1.0, "reference.j_max": 1e3}
        result = run("Profile", {"x": ("r", "rd", "rdd")}, target / SPEED + settling, start, gains=gains)
    return result["time"].to_numpy(), result["mass_x.x"].to_numpy()


def rigid(target: float) -> float:
    """Way of the axis on a contact without presliding after a jump of the target [m]."""
    models = {"pid": "PID", "mass": "KarnoppMass"}
    wires = ["mass.x -> pid.x", "mass.v -> pid.v", "pid.u -> mass.F_ext"]
    start = {"pid.r": target, "pid.rd": 0.0, "pid.rdd": 0.0, "pid.Kp": KP, "pid.Kd": KD, "pid.Ki": 0.0, "pid.Ts": TS}
    result = simulate(models, wires, start | {"mass.DV": 1e-6}, SETTLING)
    return float(result["mass.x"][-1])


def main(folder: Path, full: bool = False) -> Effect:
    """Draw the way to some targets and the errors that stay, check them against their bound."""
    band = FS / KP
    figure, (ways, errors) = panels(
        "Without an integral, an axis can stop up to Fs/Kp from its target", 1, 2, (9.0, 4.2)
    )
    checks: list[Check] = []
    left: dict[str, dict[float, float]] = {"slow": {}, "jump": {}, "rigid": {}}
    for share, moved in MOVED.items():
        t, x = lugre(share * band, jump=False)
        left["slow"][share] = (share * band - x[-1]) / band
        checks.append(
            near(f"LuGre, moving target at {share:g} Fs/Kp: distance moved", 1e3 * x[-1], 1e3 * moved, 5e-3, "mm")
        )
        if share in (0.95, 1.05, 2.0):
            colour = {0.95: RED, 1.05: BLUE, 2.0: GREEN}[share]
            ways.plot(t[::20], x[::20] / band, color=colour, lw=1.4, label=f"target at {share:g} Fs/Kp")
            ways.axhline(share, color=colour, lw=0.8, ls=":")
    for share, moved in JUMPED.items():
        t, x = lugre(share * band, jump=True)
        left["jump"][share] = (share * band - x[-1]) / band
        checks.append(
            near(f"LuGre, target jumps to {share:g} Fs/Kp: distance moved", 1e3 * x[-1], 1e3 * moved, 5e-3, "mm")
        )
    for share in RIGID:
        x_end = rigid(share * band)
        left["rigid"][share] = (share * band - x_end) / band
        if share < 1.0:
            checks.append(Check(f"rigid, target jumps to {share:g} Fs/Kp: distance moved", 1e3 * x_end, "mm", 0.0, 0.0))
        else:
            checks.append(Check(f"rigid, target jumps to {share:g} Fs/Kp: distance moved", 1e3 * x_end, "mm", 1.0))
    largest = max(abs(e) for found in left.values() for e in found.values())
    checks.append(Check("largest remaining error over Fs/Kp", largest, "", 0.0, 1.0))
    if full:
        for target, moved in SERVO.items():
            x = lugre(target, jump=True, Kp=3.0 * OMEGA**2, Kd=3.0 * OMEGA, settling=2.0)[1]
            share = abs(target - x[-1]) * 3.0 * OMEGA**2 / FS
            name = f"gains of 15 Hz, target jumps to {1e6 * target:g} µm"
            checks.append(near(f"{name}: distance moved", 1e6 * x[-1], 1e6 * moved, 5e-3, "µm"))
            checks.append(Check(f"{name}: remaining error over Fs/Kp", share, "", 0.0, 1.0))

    errors.plot([0.0, 1.0, 2.2], [0.0, 1.0, 1.0], color=GREY, lw=1.0, label="does not move; bound Fs/Kp")
    looks = {"slow": (RED, "o", "LuGre, moving target"), "jump": (BLUE, "s", "LuGre, target jumps")}
    looks["rigid"] = (BLACK, "x", "rigid, target jumps")
    for case, (colour, marker, label) in looks.items():
        shares, stays = list(left[case]), list(left[case].values())
        errors.plot(shares, stays, color=colour, marker=marker, ls="", ms=6, label=label)
    ways.set(xlabel="time [s]", ylabel="position / (Fs/Kp)")
    ways.legend(fontsize=9, loc=(0.03, 0.62))
    errors.set(xlabel="target / (Fs/Kp)", ylabel="remaining error / (Fs/Kp)", xlim=(0.0, 2.2), ylim=(0.0, 1.1))
    errors.legend(fontsize=9, loc="lower right")
    save(figure, __file__, folder)
    return Effect(
        f"The largest remaining error is {largest:.3f} Fs/Kp. On LuGre, a target that moves slowly to 0.95 Fs/Kp moves "
        f"the axis by {1e6 * (0.95 - left['slow'][0.95]) * band:.0f} µm, one that jumps there by "
        f"{1e3 * (0.95 - left['jump'][0.95]) * band:.0f} mm; on a rigid contact the axis does not move.",
        tuple(checks),
    )


if __name__ == "__main__":
    command_line(main)
