"""Records of measured motion and force: reading, units, sampling, and checks of the excitation."""

from typing import Final

COLUMNS_EXAMPLE: Final = "time=1 ms, position=4 1/8192 rev, current='Motor current' mA"  # of the option ``--columns``
