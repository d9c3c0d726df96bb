"""The state of the lab in its address: what is no number or no model is ignored."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

SHARE = Path(__file__).parents[2] / "docs" / "lab" / "share.js"
PROGRAM = """
globalThis.FrictionLive = { presets: [], views: [{ id: "contact" }], catalogue: { models: ["LuGre"] } };
require("vm").runInThisContext(require("fs").readFileSync(process.argv[1], "utf8"));
console.log(JSON.stringify(FrictionLive.share.fromHash(process.argv[2])));
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
@pytest.mark.parametrize(
    ("address", "models", "first"),
    [
        ("a.Fc=2&a.vs=%20&a.Fs=&a.A=NaN&a.n=Infinity", ["LuGre"], {"Fc": 2}),
        ("models=<script>alert(1)</script>,toString&a.__proto__=5", ["LuGre"], {}),
    ],
)
def test_an_address_gives_numbers_of_known_models(address: str, models: list[str], first: dict[str, float]) -> None:
    command = ["node", "-e", PROGRAM, str(SHARE), f"#view=contact&{address}"]
    found = json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=60).stdout)
    assert (found["models"], found["first"], found["setup"]) == (models, first, {})
