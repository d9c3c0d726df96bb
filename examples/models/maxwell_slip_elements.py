"""Maxwell slip adds springs that start to slide one after the other

Left: N massless elements in parallel, each a spring k_i that drags a slider at zeta_i with the friction W_i. Right:
three elements and their sum, the hysteresis force of the modified Leuven model, on a path between 30 µm and -30 µm.

The elements obey (1.18) to (1.20), F_i = k_i (z - zeta_i) while |z - zeta_i| < W_i/k_i, and in slip zeta_i = z - sgn(z
- zeta_i) W_i/k_i. The script computes them in this form, with the positions zeta_i; the FMU integrates the forces. From
rest the sum is the sum of min(k_i z, W_i), and the loop has the area of 4 W_i (A - W_i/k_i), summed.

Source: Lampaert, Swevers, Al-Bender, IEEE TAC 47(4), 2002.
"""

from pathlib import Path

import numpy as np

from _common import BLACK, BLUE, GREEN, RED, Array, along, command_line, panels, polyline, save
from _sketch import elements

K, W = np.array([6e4, 3e4, 2e4]), np.array([0.3, 0.3, 0.4])  # [N/m], [N]
A, SPEED, STEP = 30e-6, 1e-5, 5e-3  # [m], [m/s], [s]: 50 nm a step
QUARTER = 600  # steps from 0 to A


def dragged(z: Array) -> Array:
    """Forces of the elements over a path, from the positions of their sliders, shape (n, 3) [N]."""
    zeta, forces = np.zeros(3), []
    for each in z:
        stretched = each - zeta
        zeta = np.where(np.abs(stretched) < W / K, zeta, each - np.sign(stretched) * W / K)
        forces.append(K * (each - zeta))
    return np.array(forces)


def main(folder: Path) -> str:
    """Draw the elements and their forces, check them against the positions of the sliders."""
    z = polyline([0.0, A, -A, A], SPEED, STEP)
    parameters = {"N": 3.0} | {f"k[{i}]": k for i, k in enumerate(K, 1)} | {f"W[{i}]": w for i, w in enumerate(W, 1)}
    names = [f"Fi[{i}]" for i in (1, 2, 3)]
    result = along("MaxwellSlip", z, STEP, parameters, names)
    F = result["friction.F"].to_numpy()
    forces = np.stack([result[f"friction.{name}"].to_numpy() for name in names], axis=1)

    figure, (drawing, loop) = panels("Maxwell slip: springs that start to slide one after the other", 1, 2, (9.4, 4.2))
    elements(drawing, "z", "W", position="\\zeta")
    loop.plot(1e6 * z, F, color=BLACK, lw=1.8, label="sum")
    for i, colour in enumerate((BLUE, GREEN, RED)):
        label = f"$k_{i + 1}$ = {1e-3 * K[i]:g} kN/m, $W_{i + 1}$ = {W[i]:g} N"
        loop.plot(1e6 * z, forces[:, i], color=colour, lw=1.3, label=label)
    loop.set(xlabel="z [µm]", ylabel="force [N]", ylim=(-1.15, 1.75))
    loop.legend(loc="upper left", fontsize=8.5, ncols=2)
    save(figure, __file__, folder)

    assert np.abs(forces - dragged(z)).max() < 1e-12
    assert np.abs(F - forces.sum(axis=1)).max() < 1e-12
    rising = z[: QUARTER + 1, None]
    assert np.abs(F[: QUARTER + 1] - np.minimum(K * rising, W).sum(axis=1)).max() < 1e-12
    area = float(np.trapezoid(F[QUARTER:], z[QUARTER:]))  # from A back to A
    assert abs(area / float(np.sum(4.0 * W * (A - W / K))) - 1.0) < 1e-9
    return (
        f"The elements slide after {', '.join(f'{1e6 * each:.0f}' for each in W / K)} µm. They agree with the "
        f"published equations to 1e-12 N if the sliders are dragged along; the loop dissipates {1e6 * area:.0f} µJ."
    )


if __name__ == "__main__":
    command_line(main)
