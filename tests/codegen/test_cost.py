"""The cost that the README of an exported law tells."""

from __future__ import annotations

from friction_fmus.codegen import Cost
from friction_fmus.codegen.export import make_export
from friction_fmus.codegen.readme import readme
from friction_fmus.codegen.target import M4F


def test_a_readme_without_the_emulator_has_the_sizes() -> None:
    text = readme(make_export("PID"), [Cost(M4F, code=100, flash=200, instance=76, static=0, frame=16)])
    assert "| flash of the law [bytes] | 100 |" in text
    assert "| instructions per step" not in text
    line = (
        "Instructions were not counted, because qemu-arm is not installed; on Debian, run `apt-get install qemu-user`."
    )
    assert line in " ".join(text.split())
