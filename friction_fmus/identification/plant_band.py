"""Band in which a record supports a rigid mass: spectra of the drive force without friction, and of the acceleration.

For a rigid mass, F - F_friction = M a at every frequency, apart from a delay between the columns. The apparent mass is

    M(f) = sqrt(S_FF / S_aa) exp(j arg S_aF)                                                       (1)

(estimator Hv of G. Rocklin, J. Crowley, H. Vold, 1985), with spectra averaged by the method of P. Welch, 1967, and over
third octaves. A servo feeds the noise of its encoder back, so that force and acceleration are coherent also where
noise dominates; (1) is then the gain of the servo over w^2, a quarter period away from a mass. Coherence alone
therefore does not show that a band is supported.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import pi
from typing import Final

import numpy as np
import scipy.signal
from numpy.typing import NDArray

from friction_fmus.errors import RecordError
from friction_fmus.identification.data.record import Array, Record
from friction_fmus.identification.fit.idim import Motion, filtered_motion
from friction_fmus.identification.fit.scores import rms

COHERENT: Final = 0.8  # coherence above which the apparent mass is known
AGREES: Final = 0.3  # largest deviation of the apparent mass, relative to the mass, in magnitude and phase
EXCEEDS: Final = 0.3  # inertia force over friction in a band above which errors of the friction do not matter
GAPS: Final = 6  # third octaves that show nothing between two that agree
AVERAGES: Final = 15  # smallest number of segments, with an overlap of a half
LONGEST: Final = 4.0  # longest segment [s]
PER_OCTAVE: Final = 3
SLOW: Final = 0.02  # speed over the largest one below which the axis may stick
DELAYS: Final = (-2.0, 4.0)  # delays of the motion behind the force, in samples, that do not count as a deviation


@dataclass(frozen=True, eq=False)
class PlantBand:
    """Band in which a record supports a rigid mass."""

    mass: float  # mass [kg] or moment of inertia [kg.m2] with which the apparent mass is compared
    supported: float
    """Frequency [Hz] up to which force and motion are coherent and agree with the mass; 0 if there is none."""
    frequency: Array  # centre frequencies of the third octaves [Hz]
    coherence: Array  # coherence of acceleration and force without friction
    apparent: Array  # magnitude of the apparent mass, equation (1) [kg or kg.m2]
    phase: Array  # phase of the apparent mass without the delay [rad]
    delay: float  # delay of the motion behind the force that fits the phase best [s]


def plant_band(records: Sequence[Record], mass: float, friction: Sequence[Array] | None = None) -> PlantBand | None:
    """Return the band in which records support a rigid mass."""
    if mass <= 0.0 or any(record.q is None or record.force is None for record in records):
        return None
    Ts = records[0].Ts
    length = min(max(len(record) for record in records) * 2 // (AVERAGES + 1), round(LONGEST / Ts))
    usable = [len(record) >= length for record in records]
    if length < 32 or sum(2 * len(r) // length - 1 for r, use in zip(records, usable, strict=True) if use) < AVERAGES:
        return None
    records = [record for record, use in zip(records, usable, strict=True) if use]
    try:
        motions = [filtered_motion(record) for record in records]
    except RecordError:
        return None
    nets = forces_without_friction(records, motions, mass)
    if friction is not None:
        own = [each for each, use in zip(friction, usable, strict=True) if use]
        other = [record.column("force") - each for record, each in zip(records, own, strict=True)]
        left, left_other = (
            rms(np.concatenate([F - np.mean(F) - mass * m.a for F, m in zip(some, motions, strict=True)]))
            for some in (nets, other)
        )
        nets = other if left_other < left else nets
    S = np.zeros((length // 2 + 1, 4), dtype=np.complex128)
    for record, net in zip(records, nets, strict=True):
        S += (2 * len(record) // length - 1) * _spectra(record, net, length)
    edges, bands = _third_octaves(np.arange(length // 2 + 1) / (length * Ts), S)
    S_aa, S_FF, S_aF, S_friction = bands.T
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.nan_to_num(np.abs(S_aF) ** 2 / (S_aa * S_FF).real)
        apparent = np.nan_to_num(np.sqrt((S_FF / S_aa).real))
    centre = np.sqrt(edges[:, 0] * edges[:, 1])
    phase = np.angle(S_aF)
    delay = _delay(centre, coherence, phase, Ts)
    phase = np.angle(np.exp(1j * (phase - 2.0 * pi * centre * delay)))
    agrees = np.abs(apparent * np.exp(1j * phase) / mass - 1.0) <= AGREES
    known = (coherence >= COHERENT) & (mass**2 * S_aa.real >= EXCEEDS**2 * S_friction.real)
    supported = _highest(edges[:, 1], known, agrees)
    return PlantBand(mass, supported, centre, coherence, apparent, phase, delay)


def forces_without_friction(records: Sequence[Record], motions: Sequence[Motion], mass: float) -> list[Array]:
    """Return the drive forces without Coulomb friction, different by direction, and viscous friction, both fitted."""
    # While the axis may stick, friction is the force, within the limits of Coulomb friction.
    top = max(float(np.max(np.abs(motion.v))) for motion in motions)
    rows, rest = [], []
    for record, motion in zip(records, motions, strict=True):
        slides = np.abs(motion.v) > SLOW * top
        rows.append(_directions(motion.v)[slides])
        rest.append((record.column("force") - mass * motion.a)[slides])
    theta = np.linalg.lstsq(np.concatenate(rows), np.concatenate(rest), rcond=None)[0]
    low, high = sorted(theta[1:])
    found = []
    for record, motion in zip(records, motions, strict=True):
        force = record.column("force")
        sliding = _directions(motion.v) @ theta
        sticking = np.clip(force, low, high)
        found.append(force - np.where(np.abs(motion.v) > SLOW * top, sliding, sticking))
    return found


def _directions(v: Array) -> Array:
    """Return the columns of viscous friction, and of Coulomb friction in either direction."""
    return np.column_stack([v, v > 0.0, v <= 0.0])


def _spectra(record: Record, net: Array, length: int) -> NDArray[np.complex128]:
    """Return the spectra S_aa, S_FF, S_aF, and that of the friction, shape (length // 2 + 1, 4)."""
    # The acceleration is the second central difference of the position: it delays nothing, and has no filter.
    q, friction = record.column("q"), record.column("force") - net
    a = np.concatenate([[0.0], q[2:] - 2.0 * q[1:-1] + q[:-2], [0.0]]) / record.Ts**2
    pairs = ((a, a), (net, net), (a, net), (friction, friction))
    found = [scipy.signal.csd(x, y, 1.0 / record.Ts, nperseg=length)[1] for x, y in pairs]
    return np.column_stack(found).astype(np.complex128)


def _third_octaves(f: Array, S: NDArray[np.complex128]) -> tuple[Array, NDArray[np.complex128]]:
    """Return the edges and the sums of spectra over third octaves, up to a quarter of the sample rate."""

    def bands() -> Iterator[tuple[float, float, NDArray[np.complex128]]]:
        low = 1.5 * f[1]  # the window spreads the mean value over the first line
        while low < 0.5 * f[-1]:
            high = max(low * 2.0 ** (1.0 / PER_OCTAVE), low + f[1])
            yield low, high, S[(f >= low) & (f < high)].sum(axis=0)
            low = high

    found = list(bands())
    return np.array([(low, high) for low, high, _ in found]), np.array([total for *_, total in found])


def _delay(f: Array, coherence: Array, phase: Array, Ts: float) -> float:
    """Return the delay from the phases that are known and within a quarter of a period, within `DELAYS`."""
    known = (coherence >= COHERENT) & (np.abs(phase) < 0.5 * pi)
    weight = np.where(known, f, 0.0)
    slope = float(weight @ phase) / float(weight @ f) / (2.0 * pi) if np.any(known) else 0.0
    return min(max(slope, DELAYS[0] * Ts), DELAYS[1] * Ts)


def _highest(upper: Array, known: NDArray[np.bool_], agrees: NDArray[np.bool_]) -> float:
    """Return the upper end of the last band that agrees before the first one that does not, or before a gap."""
    supported, gap = 0.0, 0
    for end, is_known, does_agree in zip(upper, known, agrees, strict=True):
        if is_known and not does_agree:
            break
        gap = 0 if is_known else gap + 1
        if supported and gap > GAPS:
            break
        if is_known:
            supported = float(end)
    return supported
