"""The content of a block's file, read once for everything that needs it."""

from typing import Final

KINDS: Final = {"friction": "friction", "plants": "plant", "controllers": "compensator", "signals": "signal"}
"""Kind of the blocks in each folder of ``fmu_src``, in the order of the catalogue; ``friction_fmus/laws`` has the laws,
compensators in Python files."""

USES: Final = (
    *("feedforward", "model feedback", "estimator", "sliding mode", "learning", "integral", "dither", "other"),
)
"""Kinds of uses of compensators."""

FAMILIES: Final = {"feedforward": "feedforward", "model feedback": "observer"} | {kind: kind for kind in USES[2:]}
"""The family of a compensator by the kind of its use, in the order of lists."""
