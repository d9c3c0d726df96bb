"""A Modelica library of the friction models, from the ``.mo`` files beside their C files."""

import re
from collections.abc import Iterable
from pathlib import Path

from friction_fmus.export.targets import Target

LAWS = """within FrictionFMUs;
package Laws "Equations of the friction models, for forces and for torques"
  extends Modelica.Icons.BasesPackage;
end Laws;
"""

COMPONENT = """
  model {law} "{summary}"
    extends Laws.{law}({velocity}, redeclare package Units = AxisUnits.{domain});
    extends Modelica.Mechanics.{domain}.Interfaces.PartialCompliantWithRelativeStates({force});
{documentation}
  end {law};
"""

DOMAINS = {
    "Translational": ("Friction forces between translational flanges", "v = v_rel", "f = F"),
    "Rotational": ("Friction torques between rotational flanges", "v = w_rel", "tau = F"),
}

ORDER = ["Translational", "Rotational", "Examples", "Laws", "Interfaces", "AxisUnits"]


def write(folder: Path) -> Path:
    """Write the library into a folder and return its path."""
    from friction_fmus.blocks.catalogue import source_folder
    from harness.storage.files import atomic_path, make_folder

    source, library = source_folder(), folder / "FrictionFMUs"
    laws = {file.stem: file.read_text(encoding="utf-8") for file in sorted((source / "friction").glob("*.mo"))}
    files = {file.name: file.read_text(encoding="utf-8") for file in (source / "modelica").glob("*.mo")}
    files |= {f"{domain}.mo": components(domain, laws) for domain in DOMAINS}
    files |= {"package.order": _lines(ORDER), "Laws/package.order": _lines(laws), "Laws/package.mo": LAWS}
    files |= {f"Laws/{name}.mo": with_assertions(text) for name, text in laws.items()}
    make_folder(library / "Laws")
    for name, text in files.items():
        with atomic_path(library / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return library


def _lines(names: Iterable[str]) -> str:
    return "".join(f"{name}\n" for name in names)


def components(domain: str, laws: dict[str, str]) -> str:
    """Return the package of the components with flanges, each of which joins a law and a class of the MSL."""
    summary, velocity, force = DOMAINS[domain]
    text = f'within FrictionFMUs;\npackage {domain} "{summary}"\n  extends Modelica.Icons.Package;\n'
    for law, code in laws.items():
        texts = {"summary": re.findall('"(.*)"', code)[0], "documentation": code[code.rindex("  annotation(") :]}
        texts["documentation"] = "  " + texts["documentation"].rsplit("\nend", 1)[0]
        text += COMPONENT.format(law=law, domain=domain, velocity=velocity, force=force, **texts)
    return f"{text}end {domain};\n"


def with_assertions(law: str) -> str:
    """Add assertions on the ranges of the parameters, with the sentence of the FMU."""
    added = ""
    for name, vector, attributes in re.findall(r"^  parameter \S+ (\w+)(\[N\])?\((.*?)\) =", law, re.M):
        limits = dict(re.findall(r"\b(min|max) = ([\w.+-]+)", attributes))
        one, i = (f"{name}[i]", '[" + String(i) + "]') if vector else (name, "")
        tests = [f"{one} {sign} {limits[end]}" for end, sign in (("min", ">="), ("max", "<=")) if end in limits]
        low, high = float(limits.get("min", "-inf")), float(limits.get("max", "inf"))
        text = f'"{name}{i} = " + String({one}) + " is outside [{low:g}, {high:g}]"'
        assertion = f"assert({' and '.join(tests)}, {text});"
        added += f"  for i in 1:N loop {assertion} end for;\n" if vector else f"  {assertion}\n" if tests else ""
    return law.replace("\nequation\n", f"\nequation\n{added}", 1)


TARGET = Target("a Modelica library of the friction models", "library", write)
