"""The cost that the README of an exported law tells."""

from __future__ import annotations

from friction_fmus.codegen import Cost
from friction_fmus.codegen.emulation import M4F, Instruction, _steps
from friction_fmus.codegen.law_export import make_export, readme


def test_a_readme_without_the_emulator_has_the_sizes() -> None:
    text = readme(make_export("PID"), [Cost(M4F, code=100, flash=200, instance=76, static=0, frame=16)])
    assert "| flash of the law [bytes] | 100 |" in text
    assert "| instructions per step" not in text
    line = (
        "Instructions were not counted, because qemu-arm is not installed; on Debian, run `apt-get install qemu-user`."
    )
    assert line in " ".join(text.split())


LOG = b"""----------------
IN: start
0x00008000:  2003       movs     r0, #3
0x00008002:  f000 fb95  bl       #0x8730

Trace 0: 0x7f53 [00000000/00008000/00000000/00000200] start
----------------
IN: law_step
0x00008730:  ee38 8a27  vadd.f32 s16, s16, s15
0x00008734:  ee37       .byte    0x37, 0xee
0x00008736:  ba4a       rev16    r2, r1
0x00008738:  4770       bx       lr

Trace 0: 0x7f60 [00000000/00008730/00000000/00000200] law_step
----------------
IN: start
0x00008006:  e7fb       b        #0x8000

Trace 0: 0x7f70 [00000000/00008006/00000000/00000200] start
Trace 0: 0x7f53 [00000000/00008000/00000000/00000200] start
Trace 0: 0x7f60 [00000000/00008730/00000000/00000200] law_step
Trace 0: 0x7f70 [00000000/00008006/00000000/00000200] start
"""


def test_steps_are_read_from_the_log_of_qemu() -> None:
    """Two steps of three instructions; QEMU shows the second half of one of them as an instruction of its own."""
    sizes = {0x8000: 2, 0x8002: 4, 0x8006: 2, 0x8730: 4, 0x8734: 4, 0x8738: 2}
    code = {address: Instruction(size, "", "") for address, size in sizes.items()}
    blocks, steps = _steps(LOG, code, 0x8730)
    assert [[blocks[i] for i in step] for step in steps] == [[(0x8730, 0x8734, 0x8738)]] * 2
