"""Laws that have the names and parameters of laws of the library, and do nothing: the doctor reads, it does not run."""

from __future__ import annotations

from pathlib import Path

from friction_fmus import build

_TEXT = '''"""A stand-in."""

from friction_fmus.lawkit.law import Input, Output, Parameter, SampleTime, law


@law("{name}", "Stand-in", source="tests", Ts=1e-3, outputs={{"u": Output("N", "force")}})
def stand_in(
    x=Input("m", 0.0, "position", optional=True),
    v=Input("m/s", 0.0, "velocity"),
{rows}
    Ts=SampleTime(),
):
    """Nothing: it only has the parameters."""
    return {{"u": 0.0 * (x + v + Ts + {names})}}
'''


def stand_in(name: str, folder: Path, **parameters: float) -> Path:
    """An FMU with the model identifier of a law."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = "\n".join(f'    {key}=Parameter("1", {value!r}, "{key}"),' for key, value in parameters.items())
    path = folder / f"{name.lower()}.py"
    path.write_text(_TEXT.format(name=name, rows=rows, names=" + ".join(parameters)), encoding="utf-8")
    return build(path, folder)
