"""Identify the stiffness and damping of a contact at rest from its response to small motions.

``python examples/identification/small_motions.py LOG.toml`` reads a record by its mapping; without an argument, it
shakes the model LuGre.

Before it slides, a contact acts as a spring and a damper. For a deflection far below the presliding displacement, LuGre
gives F = sigma0 x + (sigma1 + sigma2) v, and the dynamic stiffness, force over position, is

    Z(w) = sigma0 - M w^2 + i w (sigma1 + sigma2).                                              (1)

It is measured at all frequencies simultaneously with noise or a sum of sines as excitation (J. Bendat, A. Piersol:
Random Data, 2nd ed., 1986, chapters 6 and 9; linearisation of LuGre: Altpeter, Ghorbel, Longchamp, "Relationship
between two friction models: a singular perturbation approach", CDC 1998).
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.signal

from friction_fmus import fmu
from friction_fmus.identification import Array, Estimate, ExcitationError, FitError, Record, RecordError, read_records
from harness import Drive, FmuPart

COHERENT = 0.9  # lower limit of the coherence; at frequencies below it, noise or sliding dominates the linear response


@dataclass(frozen=True, eq=False)
class PreslidingFit:
    """Stiffness and damping of a contact at rest.

    Attributes
    ----------
    parameters : mapping of str to Estimate
        sigma0 (stiffness), "sigma1 + sigma2" (damping; small motions only determine the sum) and, for a drive force, M
        (moved mass).
    frequency : array, shape (m,)
        Frequencies used in the fit [Hz].
    stiffness : complex array, shape (m,)
        Measured dynamic stiffness, force over position.
    coherence : array, shape (m,)
        Coherence of excitation and response, 0 to 1.
    stroke : float
        Largest deviation of the position from its mean, in the unit of the position.
    """

    parameters: Mapping[str, Estimate]
    frequency: Array
    stiffness: np.ndarray[tuple[int], np.dtype[np.complex128]]
    coherence: Array
    stroke: float

    def values(self) -> dict[str, float]:
        """Return the values of the parameters."""
        return {name: estimate.value for name, estimate in self.parameters.items()}


def identify_presliding(
    record: Record,
    *,
    band: tuple[float, float] | None = None,
    mass: float | None = None,
    held: bool = False,
    segments: int = 16,
) -> PreslidingFit:
    """Identify stiffness and damping of a contact at rest from a record of small motions.

    Parameters
    ----------
    record : Record
        Position, and friction or drive force, of an axis excited within its presliding displacement by noise or by a
        sum of sines with at least two frequencies.
    band : (float, float), optional
        Frequency band to use [Hz]; by default all frequencies with a coherent response.
    mass : float, optional
        Known moved mass, in `units.inertia`; only for a drive force.
    held : bool
        Whether the force is a command held between samples, as by a sampled servo. The force on the axis is then
        delayed by half a sample, which would otherwise appear as damping.
    segments : int
        Number of segments over which the spectra are averaged; at least 4.

    Returns
    -------
    PreslidingFit
        Stiffness and damping with standard errors, and the measured dynamic stiffness.

    Raises
    ------
    RecordError
        If a column is missing, or the record is too short.
    ExcitationError
        If the response is coherent at fewer than 3 frequencies.
    FitError
        If the band, the mass or the number of segments is invalid.

    Notes
    -----
    Equation (1), Z(w) = sigma0 - M w^2 + i w (sigma1 + sigma2), is fitted to the ratio of averaged spectra (Welch, Hann
    window, overlap of one half) by least squares. The weights follow from the coherence g^2: the variance is
    |Z|^2 (1 - g^2) / (2 n g^2) for n segments (Bendat, Piersol 1986, section 9.2). Noise is assumed in the position
    for a drive force, and otherwise in the measured friction.

    The stiffness decreases with the amplitude A as the contact starts to slide: by the fraction (sigma0 A / Fc)^2 / 3
    for the tip of Dahl's loop, Fc tanh(sigma0 A / Fc). Use amplitudes below a tenth of Fc / sigma0, and check that half
    the amplitude gives the same result.
    """
    _check(record, band, mass, segments)
    q = record.column("q")
    drive = record.friction is None
    force = record.column("force" if drive else "friction")
    size = 2 * len(q) // (segments + 1)
    given, answer = (force, q) if drive else (q, force)
    f, across = scipy.signal.csd(given, answer, 1.0 / record.Ts, nperseg=size)
    _, own = scipy.signal.welch(given, 1.0 / record.Ts, nperseg=size)
    _, coherence = scipy.signal.coherence(given, answer, 1.0 / record.Ts, nperseg=size)
    low, high = band or (0.0, np.inf)
    used = (f > 1.5 / (size * record.Ts)) & (f >= low) & (f <= high) & (coherence > COHERENT)
    if np.count_nonzero(used) < 3:
        raise ExcitationError(
            f"Force and position of the record {record.name!r} are coherent at {np.count_nonzero(used)} frequencies, "
            "but at least 3 are needed; excite the axis at rest with noise or many sines within the band, with an "
            "amplitude below its presliding displacement."
        )
    f, coherence = f[used], coherence[used]
    Z = own[used] / across[used] if drive else across[used] / own[used]
    w = 2.0 * np.pi * f
    if held:
        Z = Z * np.sinc(f * record.Ts) * np.exp(-0.5j * w * record.Ts)
    known = -w * w * mass if mass is not None else 0.0
    columns = [np.ones_like(w), 1j * w]
    names = ["sigma0", "sigma1 + sigma2"]
    if drive and mass is None:
        columns.append(-w * w + 0j)
        names.append("M")
    spread = np.abs(Z) * np.sqrt(np.maximum(1.0 - coherence, 1e-12) / (2.0 * 0.5 * (segments + 1) * coherence))
    W = np.column_stack(columns) / spread[:, None]
    rows = np.concatenate([W.real, W.imag])
    right = (Z - known) / spread
    scale = np.linalg.norm(rows, axis=0)
    covariance = np.linalg.inv((rows / scale).T @ (rows / scale)) / np.outer(scale, scale)
    theta = covariance @ (rows.T @ np.concatenate([right.real, right.imag]))
    # segments overlap, and the window correlates neighbouring frequencies
    errors = np.sqrt(1.5 * np.diag(covariance))
    units = {"M": record.units.inertia, "sigma1 + sigma2": record.units.viscous}
    stiffness_unit = f"{record.units.force}/{record.units.position}"
    return PreslidingFit(
        {
            name: Estimate(name, float(value), float(error), units.get(name, stiffness_unit))
            for name, value, error in zip(names, theta, errors, strict=True)
        },
        frequency=f,
        stiffness=Z,
        coherence=coherence,
        stroke=float(np.max(np.abs(q - np.mean(q)))),
    )


def _check(record: Record, band: tuple[float, float] | None, mass: float | None, segments: int) -> None:
    if band is not None and not 0.0 <= band[0] < band[1]:
        raise FitError(f"The band {band[0]:g} .. {band[1]:g} Hz is empty; give the lower frequency first.")
    if mass is not None and not mass >= 0.0:
        raise FitError(f"The mass is {mass:g}; it must not be negative.")
    if mass is not None and record.friction is not None:
        raise FitError(f"The record {record.name!r} has measured friction, so the mass is not used; omit it.")
    if segments < 4:
        raise FitError(f"There are {segments} segments; use at least 4 to estimate the coherence.")
    if len(record) < 32 * segments:
        raise RecordError(
            f"The record {record.name!r} has only {len(record)} samples for {segments} segments; use a longer record "
            "or fewer segments."
        )


def shaken_contact() -> Record:
    """Return a record of LuGre, moved by noise within a fiftieth of its presliding displacement."""
    Ts = 1e-3
    band = scipy.signal.butter(2, (2.0, 60.0), "bandpass", fs=1.0 / Ts, output="sos")
    v = np.asarray(scipy.signal.sosfilt(band, np.random.default_rng(3).normal(size=20_000)), dtype=np.float64)
    q = Ts * (np.cumsum(v) - 0.5 * (v + v[0]))  # the velocity varies linearly between samples
    scale = 0.02 * 1.5e-5 / np.max(np.abs(q))
    force = Drive(FmuPart("contact", fmu("LuGre"))).run({"v": scale * v}, ["F"], Ts, between="linear")[:, 0]
    return Record("LuGre", np.linspace(0.0, Ts * (v.size - 1), v.size), q=scale * q, friction=force)


if __name__ == "__main__":
    records, band = (read_records(sys.argv[1]), None) if sys.argv[1:] else ([shaken_contact()], (3.0, 50.0))
    for record in records:
        for found in identify_presliding(record, band=band).parameters.values():
            print(f"{record.name}: {found.name} = {found.value:.4g} {found.unit}, error {found.standard_error:.2g}")
