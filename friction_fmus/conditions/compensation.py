"""Conditions on friction compensation: how much the drive can apply, and how much may be compensated."""

from friction_fmus.conditions.condition import (
    Condition,
    above,
    at_most,
    below,
    compared,
)


def break_away(most: float, Fs: float, direction: str = "forward") -> Condition:
    """Check that the drive can break the axis away: the largest force behind all limits is above static friction.

    Parameters
    ----------
    most : float
        Largest force of the drive in this direction [N].
    Fs : float
        Static friction [N].
    direction : str
        ``forward`` or ``backward``, for the text.

    Returns
    -------
    Condition
        Its value is the largest force, its bound static friction [N].
    """
    return Condition(
        "break-away",
        *compared(above, most, Fs),
        wrong=f"the largest {{force}} {direction}, behind all limits, is {most:.4g} {{N}}; static friction is "
        f"{Fs:.4g} {{N}}",
        why="the drive cannot start a slow motion in that direction: the axis sticks",
        change=f"raise the limits of the law and of the actuator above {Fs:.4g} {{N}}",
        source="balance of {force}s at rest",
    )


def overcompensation(share: float, measured: bool = True) -> Condition:
    """Check that the compensation does not exceed the friction of the axis: a ratio of at most 1.

    Parameters
    ----------
    share : float
        Ratio of compensated friction to the friction of the axis, at the speed where it is largest.
    measured : bool
        Whether the compensation is computed from the measured velocity; otherwise from the reference.

    Returns
    -------
    Condition
        Its value is the ratio, its bound 1.
    """
    why = (
        "the excess {force} pushes in the direction of motion: a limit cycle that grows with the gain"
        if measured
        else "the excess {force} pushes in the direction of the reference: the axis overshoots at each reversal"
    )
    return Condition(
        "over-compensation",
        *compared(at_most, share, 1.0),
        wrong=f"the compensation is {share:.4g} times the friction of the axis",
        why=why,
        change=f"multiply the gain by {0.9 / share:.2g}, or correct the friction parameters of the law"
        if share > 0.0
        else "no change is needed",
        source="Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994; Papadopoulos, Chasparis, IROS 2002",
    )


def fed_back_stiffness(fed_back: float, stiffness: float) -> Condition:
    """Check that a law feeds back less stiffness than contact and loop have: gain s0_hat is below s0 + Kp + k.

    Parameters
    ----------
    fed_back : float
        Contact stiffness in the law's model, times the gain of the law [N/m].
    stiffness : float
        Stiffness of the real contact, the position loop and a spring to ground together [N/m].

    Returns
    -------
    Condition
        Its value is the stiffness fed back, its bound the stiffness of contact and loop [N/m].
    """
    return Condition(
        "fed-back stiffness",
        *compared(below, fed_back, stiffness),
        wrong=f"the law feeds back a stiffness of {fed_back:.4g} {{N_m}}; contact and loop have only {stiffness:.4g} "
        f"{{N_m}}",
        why="the resulting stiffness in presliding is negative: the axis leaves presliding by itself, to one side and "
        "back",
        change=f"correct sigma0 of the law, or multiply its gain by {0.9 * stiffness / fed_back:.2g}"
        if fed_back > 0.0
        else "no change is needed",
        source="sum of stiffnesses at rest; derived here",
    )
