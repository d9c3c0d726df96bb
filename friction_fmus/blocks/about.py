"""What a block tells of itself beside its equations, for the page, the doctor, the study and the identification."""

from __future__ import annotations

from dataclasses import dataclass

from friction_fmus.blocks.rows import string, words


@dataclass(frozen=True)
class About:
    """What the file of a block says of it.

    Attributes
    ----------
    portrait : str
        Name of the experiment that shows what the block does, see `friction_fmus.portrait.choice`; empty: the ports
        decide.
    quotes : tuple of str
        Functions of `friction_fmus.conditions` that the documentation page quotes; the doctor evaluates them where the
        block is used.
    """

    portrait: str = ""
    quotes: tuple[str, ...] = ()


def about_c_block(code: str) -> About:
    """Return what the macros of a C file say.

    Parameters
    ----------
    code : str
        The source.

    Raises
    ------
    FrictionError
        A macro is not understood.
    """
    return About(string(code, "PORTRAIT"), words(string(code, "QUOTES")))
