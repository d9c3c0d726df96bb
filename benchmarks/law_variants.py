"""Other ways to write and to translate the two laws that are compared with C by hand."""

from __future__ import annotations

from pathlib import Path
from unittest.mock import patch

import casadi
from casadi import MX, exp, expm1, fabs, if_else

from benchmarks.law_runs import LawC
from friction_fmus.codegen.law_export import make_export
from friction_fmus.codegen.layout import Export, is_flag
from friction_fmus.lawkit.emit import branches
from friction_fmus.lawkit.law import Law

CURVE = "stribeck_level({0}, Fc, Fs, vs, delta)"
PLAIN_CURVE = "(Fc + (Fs - Fc) * casadi.exp(-(({0} / vs) ** delta)))"

FORMULATIONS = {
    "LuGreObserver": {
        "implicit step": (
            "acting(rate, Ts)",
            "Ts / (1.0 + Ts * rate)",
        ),
        "always pow and exp": (
            CURVE.format("fabs(v)"),
            PLAIN_CURVE.format("fabs(v)"),
        ),
    },
    "GMSFeedforward": {
        "implicit step": ("exp(-C * span / S)", "1.0 / (1.0 + C * span / S)"),
        "always pow and exp": (
            CURVE.format("fabs(dr / span)"),
            PLAIN_CURVE.format("fabs(dr / span)"),
        ),
    },
}
"""Law -> what is different -> text in the law file, and in its place."""


def variants(export: Export, folder: Path) -> dict[str, LawC]:
    """The law in all these ways, compiled."""
    law = export.law
    found = {}
    for i, (text, (old, new)) in enumerate(FORMULATIONS[law.name].items()):
        path = folder / f"formulation{i}.py"
        lines = law.path.read_text(encoding="utf-8")
        if lines.count(old) != 1:
            raise SystemExit(f"{law.path.name} does not have {old!r} once: the variant must be written anew")
        path.write_text(
            lines.replace(old, new).replace("from casadi", "import casadi\nfrom casadi", 1), encoding="utf-8"
        )
        found[text] = LawC(make_export(path), folder / path.stem)
    with patch.object(branches, "PAYS", float("inf")):
        # another export, as the first one keeps its statements
        found["both sides of decisions"] = LawC(make_export(law.name), folder / "selects")
    found["casadi's C"] = by_casadi(export, law.function, folder / "casadi")
    if law.name == "LuGreObserver":
        found["casadi's C, short-circuit"] = by_casadi(export, observer_in_mx(law), folder / "short")
    return found


def by_casadi(export: Export, function: casadi.Function, folder: Path) -> LawC:
    """The C that casadi writes for a function of the law's arguments, called on the same structs."""
    folder.mkdir(parents=True, exist_ok=True)
    generator = casadi.CodeGenerator("generated.c", {"with_export": False, "static_aux": True, "casadi_int": "int"})
    generator.add(function)
    generator.generate(f"{folder}/")
    given, truths = [], []
    for variable in export.law.given:
        for place in export.places(variable):
            if is_flag(variable):
                truths.append(f"    const double truth{len(given)} = (double){place};")
                given.append(f"&truth{len(given)}")
            else:
                given.append(f"&{place}")
    p, count = export.prefix, len(export.results)
    source = folder / "called.c"
    source.write_text(
        "\n".join(
            [
                '#include "generated.c"',
                f"static void by_casadi(const {p}_parameters *parameters, {p}_states *states,",
                f"                      const {p}_inputs *inputs, {p}_outputs *outputs)",
                "{",
                *truths,
                f"    const double *arguments[{function.sz_arg()}] = {{{', '.join(given)}}};",
                f"    double values[{count}], *results[{function.sz_res()}] = {{0}};",
                f"    double w[{max(function.sz_w(), 1)}];",
                f"    int iw[{max(function.sz_iw(), 1)}];",
                f"    for (int i = 0; i < {count}; i++)",
                "        results[i] = values + i;",
                f"    {function.name()}(arguments, results, iw, w, 0);",
                *(f"    {place} = values[{i}];" for i, place in enumerate(export.results)),
                "    outputs->fault = 0;",
                "}",
                "",
            ]
        ),
        encoding="utf-8",
    )
    return LawC(export, folder, step="by_casadi", source=source, flags=("-w",))


def observer_in_mx(law: Law) -> casadi.Function:
    """LuGreObserver once more, in casadi's MX, whose decisions are calls of functions."""
    symbols = {variable.name: MX.sym(variable.name) for variable in law.given}
    r, x, v, enable, reset, z = (symbols[name] for name in ("r", "x", "v", "enable", "reset", "z"))
    gain, k, sigma0, sigma1, sigma2 = (symbols[name] for name in ("gain", "k", "sigma0", "sigma1", "sigma2"))
    Fc, Fs, vs, delta, u_min, u_max, Ts = (
        symbols[name] for name in ("Fc", "Fs", "vs", "delta", "u_min", "u_max", "Ts")
    )

    def decide(condition: MX, first: MX | float, second: MX | float) -> MX:
        return if_else(condition, first, second, True)

    old = decide(reset, 0.0, z)
    rate = sigma0 * fabs(v) / (Fc + (Fs - Fc) * exp(-((fabs(v) / vs) ** delta)))
    drive = v + k * (r - x)
    slope = drive - rate * old
    F_hat = gain * (sigma0 * old + sigma1 * slope + sigma2 * v)
    q = rate * Ts
    phi = decide(q < 1e-5, 1.0 - q / 2.0, -expm1(-q) / decide(q < 1e-5, 1.0, q))
    u = decide(F_hat < u_min, u_min, decide(F_hat > u_max, u_max, F_hat))
    u_sat = decide(F_hat < u_min, -1.0, decide(F_hat > u_max, 1.0, 0.0))
    goes_on = decide(enable, decide(reset, 0.0, old + Ts * phi * slope), 0.0)
    results = [decide(enable, u, 0.0), decide(enable, F_hat, 0.0), decide(enable, u_sat, 0.0), goes_on]
    return casadi.Function("observer", list(symbols.values()), results)
