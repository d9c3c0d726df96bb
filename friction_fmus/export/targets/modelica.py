"""A Modelica library: friction models, from the ``.mo`` files beside their C files, and compensators on their C."""

import re
from pathlib import Path

from friction_fmus.export.targets import Target, write_file

ROTATIONAL = """within FrictionFMUs.Compensators;
package Rotational "Compensators for torques and angles"
  extends Modelica.Icons.Package;
{blocks}end Rotational;
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

PARAMETER = r"^  parameter \S+ ('?(\w+)'?)(?:\[(\w+)\])?\((.*?)\) ="

ORDER = ["Translational", "Rotational", "Compensators", "Examples", "Laws", "Interfaces", "AxisUnits"]


def write(folder: Path) -> Path:
    """Write the library into a folder and return its path."""
    from friction_fmus.blocks.catalogue import PACKAGE

    library, shipped = folder / "FrictionFMUs", PACKAGE / "modelica"  # a checkout has none
    written = {file.relative_to(shipped).as_posix(): file for file in shipped.rglob("*.*")}
    files = {name: file.read_text(encoding="utf-8") for name, file in written.items()} or generated()
    for name, text in files.items():
        write_file(text, library / name)
    return library


def generated() -> dict[str, str]:
    """Return the texts of the files of the library, by their places in it."""
    from friction_fmus.blocks.catalogue import laws_folder, source_folder
    from friction_fmus.codegen.law_export import make_export
    from friction_fmus.codegen.modelica_block import block, c_header, rotational
    from friction_fmus.lawkit.law import discover_laws

    own = source_folder() / "modelica"
    laws = {file.stem: file.read_text(encoding="utf-8") for file in sorted((own.parent / "friction").glob("*.mo"))}
    names = sorted(law.name for law in discover_laws(laws_folder()))
    exports = [make_export(name, prefix=f"FrictionFMUs_{name}") for name in names]
    files = {file.relative_to(own).as_posix(): file.read_text(encoding="utf-8") for file in own.rglob("*.mo")}
    files |= {f"{domain}.mo": components(domain, laws) for domain in DOMAINS}
    files |= {f"Laws/{name}.mo": with_assertions(text) for name, text in laws.items()}
    files |= {f"Compensators/{export.law.name}.mo": with_assertions(block(export)) for export in exports}
    files |= {"Compensators/Rotational.mo": ROTATIONAL.format(blocks="".join(map(rotational, exports)))}
    files |= {f"Resources/Include/{export.prefix}.h": c_header(export) for export in exports}
    for package, order in {"": ORDER, "Laws/": laws, "Compensators/": [*names, "Rotational"]}.items():
        files[f"{package}package.order"] = "".join(f"{name}\n" for name in order)
    return files


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
    for name, plain, length, attributes in re.findall(PARAMETER, law, re.MULTILINE):
        limits = dict(re.findall(r"\b(min|max) = ([\w.+-]+)", attributes))
        one, i = (f"{name}[i]", '[" + String(i) + "]') if length else (name, "")
        tests = [f"{one} {sign} {limits[end]}" for end, sign in (("min", ">="), ("max", "<=")) if end in limits]
        low, high = float(limits.get("min", "-inf")), float(limits.get("max", "inf"))
        text = f'"{plain}{i} = " + String({one}) + " is outside [{low:g}, {high:g}]"'
        assertion = f"assert({' and '.join(tests)}, {text});"
        added += f"  {f'for i in 1:{length} loop {assertion} end for;' if length else assertion}\n" * bool(tests)
    return law.replace("\nequation\n", f"\nequation\n{added}", 1)


TARGET = Target("a Modelica library of the friction models and compensators", "library", write)
