"""Checks of an FMU: the archive, the XML, and the behaviour of the binary in a separate process.

An SSP is read as the harness reads it, and each of its FMUs is checked. The checks apply to any FMI 2.0 or 3.0 FMU.
The rules are functions in `archive_rules`, `fmi2_rules` and `fmi3_rules`, and probes in `probes`; each rule is one
function.
"""

from collections.abc import Collection, Iterator
from dataclasses import replace
from pathlib import Path

from fmpy.model_description import ValidationError

from friction_fmus.check.archive_rules import (
    DAMAGED,
    Contents,
    examine_archive,
    misplaced_libraries,
    open_contents,
    read_member,
    truncated_libraries,
)
from friction_fmus.check.binary import examine_binary
from friction_fmus.check.description import (
    NO_INTERFACE,
    SCHEMA,
    VERSION,
    Model,
    line_of,
    parse,
    violations,
    wrong_encoding,
)
from friction_fmus.check.findings import DESCRIPTION, RULES, Finding, Rule, apply, declare
from friction_fmus.check.fmi2_rules import examine_side_files
from friction_fmus.check.fmi3_rules import Model3
from friction_fmus.errors import FrictionError, UnknownNameError, did_you_mean
from harness.errors import HarnessError
from harness.parts.archive import parse_description
from harness.ssp.package import SSD_NAME
from harness.storage.files import ScratchFolder

__all__ = ["RULES", "Finding", "Rule", "check"]

_DANGEROUS = ("zip-", "path-outside", "path-backslash", "path-symlink", "path-duplicate", "path-clash", "path-long")

_ONLY_FMI_2 = ("source-headers", "source-undeclared")  # rules of the archive that do not hold in FMI 3.0

SCHEMA_3 = declare("fmi3-schema", "error", "2.4", "modelDescription.xml violates the schema of FMI 3.0.", "fmi3")
SSP = declare("ssp", "error", "5", "The harness cannot read the system that an SSP describes.", "ssp")
FMPY = declare("fmpy", "error", "2.2", "The check of fmpy finds an error that no other rule finds.", "description")


def check(
    path: str | Path, *, static: bool = False, ignore: Collection[str] = (), time_limit: float = 30.0
) -> list[Finding]:
    """Check one FMU, or an SSP with its FMUs.

    Parameters
    ----------
    path : path-like
        The FMU or the SSP.
    static : bool
        Whether to skip the checks that run the binary.
    ignore : collection of str
        Names of rules to ignore.
    time_limit : float
        Longest duration of each probe of the binary [s].

    Returns
    -------
    list of Finding
        The findings in order of severity. A file that is not an FMI 2.0 or 3.0 FMU gives one finding.

    Raises
    ------
    FrictionError
        If the file cannot be read, `ignore` contains an unknown rule, or the time limit is not positive.
    """
    for name in ignore:
        if name not in RULES:
            raise UnknownNameError(f"there is no rule {name!r}{did_you_mean(name, RULES)}; `check --rules` lists them")
    if not time_limit > 0.0:
        raise FrictionError(f"the time limit is {time_limit} s; give a positive number of seconds")
    try:
        found = _examine(Path(path), static, time_limit)
    except OSError as error:
        reason = error.strerror or str(error)
        raise FrictionError(f"cannot check {path}: {reason}; give the path of an .fmu or .ssp file") from error
    order = ("error", "warning", "note")
    chosen = [finding for finding in found if finding.rule not in ignore]
    return sorted(chosen, key=lambda finding: (order.index(finding.severity), finding.file, finding.line or 0))


def _examine(path: Path, static: bool, time_limit: float) -> list[Finding]:
    contents = open_contents(path)
    if isinstance(contents, Finding):
        return [contents]
    with contents.archive:
        return _examine_contents(path, contents, static, time_limit)


def _examine_contents(path: Path, contents: Contents, static: bool, time_limit: float) -> list[Finding]:
    if SSD_NAME in contents.names and DESCRIPTION not in contents.names:
        return _examine_ssp(path, contents, static, time_limit)
    if DESCRIPTION not in contents.names or any(f.rule == "zip-bomb" for f in apply("archive", contents)):
        return examine_archive(contents)
    data = read_member(contents, DESCRIPTION)
    if isinstance(data, Finding):
        found = examine_archive(contents)
        return found if any(finding.file == data.file for finding in found) else [*found, data]
    root = parse(data)
    if isinstance(root, Finding):
        return [*examine_archive(contents), root]
    three = root.tag == "fmiModelDescription" and root.get("fmiVersion", "").startswith("3.")
    model = Model3(root) if three else Model(root)
    if isinstance(model, Model) and (refusals := list(_refusals(model))):
        return refusals
    sources = model.source_files if isinstance(model, Model) else None
    version = 3 if three else 2
    contents = replace(contents, identifiers=model.identifiers, source_files=sources, version=version)
    findings = [each for each in examine_archive(contents) if not (three and each.rule in _ONLY_FMI_2)]
    findings += wrong_encoding(data, root)
    violated, schema = (SCHEMA_3, _XSD_3) if three else (SCHEMA, _XSD)
    findings += [violated.finding(text, DESCRIPTION, line=line) for text, line in violations(root, schema)]
    common = list(apply("both", model))
    if not (three and _errors(findings)):
        findings += apply("fmi3" if three else "description", model)
    findings += common
    if not any(finding.rule.startswith(_DANGEROUS) for finding in findings):
        findings += examine_side_files(contents, model)
        if not _errors(findings):
            findings += _fmpy(data)
        findings += _libraries(contents, model, static or (three and _errors(findings)), time_limit)
    return [replace(finding, standard="FMI 3.0.2") for finding in findings] if three else findings


def _examine_ssp(path: Path, contents: Contents, static: bool, time_limit: float) -> list[Finding]:
    """Return the findings in an SSP, and those in each of its FMUs with the path of the FMU in the SSP."""
    from harness.system.system import System  # takes long to load

    found = [f for f in examine_archive(contents) if f.rule.startswith(_DANGEROUS) or f.rule == DAMAGED.id]
    if found:
        return [replace(finding, standard=SSP.standard) for finding in found]
    try:
        with System.from_ssp(path):
            pass
    except HarnessError as error:
        found.append(SSP.finding(str(error), SSD_NAME))
    with ScratchFolder() as folder:
        for name in sorted(name for name in contents.names if name.endswith(".fmu")):
            fmu = Path(contents.archive.extract(name, folder))
            found += (replace(each, file=f"{name}/{each.file}") for each in _examine(fmu, static, time_limit))
    return found


def _errors(findings: list[Finding]) -> bool:
    return any(finding.severity == "error" for finding in findings)


def _libraries(contents: Contents, model: Model | Model3, static: bool, time_limit: float) -> list[Finding]:
    truncated = list(truncated_libraries(contents))
    misplaced = list(misplaced_libraries(contents))
    if static or truncated or not contents.below("binaries"):
        return truncated + misplaced
    return misplaced + examine_binary(contents, model, time_limit)


_XSD = "fmi2/fmi2ModelDescription.xsd"
_XSD_3 = "fmi3/fmi3ModelDescription.xsd"


def _refusals(model: Model) -> Iterator[Finding]:
    """Yield the reasons why the rules do not apply to this file."""
    version = model.root.get("fmiVersion", "")
    if model.root.tag != "fmiModelDescription":
        text = f"the root element is {model.root.tag}, not fmiModelDescription; export it as FMI 2.0"
        yield VERSION.finding(text, DESCRIPTION, line=line_of(model.root))
    elif version != "2.0":
        text = f"fmiVersion is {version!r}, but only 2.0 and 3.0 are supported; export it as FMI 2.0 or 3.0"
        yield VERSION.finding(text, DESCRIPTION, line=line_of(model.root))
    elif not model.interfaces:
        text = "the FMU declares neither CoSimulation nor ModelExchange; export it again"
        yield NO_INTERFACE.finding(text, DESCRIPTION, line=line_of(model.root))


def _fmpy(data: bytes) -> list[Finding]:
    """Return the findings of fmpy, which runs only if there are no other findings, to avoid duplicates.

    It does not check the names of variables, for which its parser needs milliseconds each; `fmi2_rules` checks them.
    """
    try:
        parse_description(data, validate=True, validate_model_structure=True)
    except ValidationError as error:
        problems = [str(text) for text in error.problems]
    except Exception as error:  # fmpy raises many kinds of exceptions
        problems = [str(error)]
    else:
        problems = []
    return [FMPY.finding(f"fmpy reports: {' '.join(text.split())}", DESCRIPTION) for text in problems]
