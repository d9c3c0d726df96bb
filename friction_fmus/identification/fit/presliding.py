"""Presliding stiffness and damping from the response to small motions about rest.

Before a contact slides it is a spring and a damper: with a deflection far below the presliding distance LuGre, for
one, gives F = sigma0 x + (sigma1 + sigma2) v. The dynamic stiffness, force over position, is then

    Z(w) = sigma0 - M w^2 + i w (sigma1 + sigma2),                                              (1)

which is measured at all frequencies at once with noise or a sum of sines as the excitation (J. Bendat, A. Piersol:
Random Data, 2nd ed., 1986, chapters 6 and 9; in presliding: Altpeter, Ghorbel, Longchamp, "Relationship between two
friction models: a singular perturbation approach", CDC 1998, linearise LuGre like this).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.signal

from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.errors import ExcitationError, FitError, RecordError
from friction_fmus.identification.fit.estimate import Estimate

#: Frequencies with less coherence than this are left out: noise, or sliding, outweighs the linear response there.
COHERENT = 0.9


@dataclass(frozen=True, eq=False)
class PreslidingFit:
    """Stiffness and damping of a contact at rest.

    Attributes
    ----------
    parameters : mapping of str to Estimate
        sigma0 (stiffness), "sigma1 + sigma2" (damping; a small motion cannot tell them apart) and, where the force is
        that of a drive, M (moved mass).
    frequency : array, shape (m,)
        Frequencies that were used [Hz].
    stiffness : complex array, shape (m,)
        Measured dynamic stiffness there, force over position.
    coherence : array, shape (m,)
        Part of the response's power that is linear in the excitation, 0 to 1.
    stroke : float
        Largest distance of the position from its mean, in the unit of the position.
    """

    parameters: Mapping[str, Estimate]
    frequency: Array
    stiffness: np.ndarray[tuple[int], np.dtype[np.complex128]]
    coherence: Array
    stroke: float

    def values(self) -> dict[str, float]:
        """Parameter values without their errors."""
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
        Position, and friction or drive force, of an axis that is shaken within its presliding distance: by noise or by
        a sum of sines of at least two frequencies.
    band : (float, float), optional
        Frequencies to use [Hz]; by default all at which the response is coherent.
    mass : float, optional
        Moved mass if it is known, only for a drive force; in `units.inertia`.
    held : bool
        Whether the force is a command that is held from each sample to the next, as by a sampled servo. What acts on
        the axis then is half a sample late, which shows as damping if it is not said.
    segments : int
        The record is cut into this many pieces, over which the spectra are averaged; at least 4.

    Returns
    -------
    PreslidingFit

    Raises
    ------
    RecordError
        A column is missing, or the record is too short.
    ExcitationError
        Too few frequencies have a coherent response.
    FitError
        The band, the mass or the number of segments makes no sense.

    Notes
    -----
    Equation (1) is fitted to the quotient of averaged spectra (Welch, Hann window, overlap of one half) by least
    squares, weighted by the variance that the coherence g^2 gives it, |Z|^2 (1 - g^2) / (2 n g^2) for n segments
    (Bendat, Piersol 1986, section 9.2). Where the force is that of a drive, noise is taken to be in the position, else
    in the measured friction.

    The stiffness falls with the amplitude A as the contact begins to slide: by (sigma0 A / Fc)^2 / 3 for the tip of
    Dahl's loop, Fc tanh(sigma0 A / Fc). So shake by less than a tenth of Fc / sigma0, and see whether half of the
    amplitude gives the same.
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
            f"The force of the record {record.name!r} and its position are coherent at {np.count_nonzero(used)} "
            f"frequencies, and at least 3 are needed; shake the axis at rest by noise or many sines within the band, "
            "and by less than its presliding distance."
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
    # a segment overlaps with its neighbours, and the window leaks into neighbouring frequencies
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
        raise FitError(f"The band {band[0]:g} .. {band[1]:g} Hz is empty; give a lower and a higher frequency.")
    if mass is not None and not mass >= 0.0:
        raise FitError(f"The mass is {mass:g}; it must not be negative.")
    if mass is not None and record.friction is not None:
        raise FitError(f"The record {record.name!r} has the friction itself, so that no mass is needed; leave it out.")
    if segments < 4:
        raise FitError(f"There are {segments} segments; take at least 4, coherence needs them.")
    if len(record) < 32 * segments:
        raise RecordError(
            f"The record {record.name!r} has {len(record)} samples, which is too few for {segments} segments; record "
            "for longer or take fewer."
        )
