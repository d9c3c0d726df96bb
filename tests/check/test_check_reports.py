"""What the command writes: text, JSON and SARIF, and the exit status."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from check.broken import contents, edited, typed, zipped
from pydantic_sarif.model import StaticAnalysisResultsFormatSarifVersion210JsonSchema as SarifLog

from friction_fmus.__main__ import main
from friction_fmus.check import RULES, check


@pytest.fixture
def fmus(build_fmu: Callable[..., Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[str, str, str]:
    """One in order, one with an error, one with a note, by their names in the working folder."""
    monkeypatch.chdir(tmp_path)
    good = build_fmu("LuGre")
    Path("good.fmu").write_bytes(good.read_bytes())
    edited(good, Path("bad one.fmu"), lambda root: typed(root, "Fc").set("start", "-1"))
    zipped(contents(good) | {"notes.txt": b"x"}, Path("note.fmu"))
    return "good.fmu", "bad one.fmu", "note.fmu"


def test_exit_status(fmus: tuple[str, str, str], capsys: pytest.CaptureFixture[str]) -> None:
    good, bad, note = fmus
    assert main(["check", "--static", good]) == 0
    assert main(["check", "--static", note]) == 0
    assert main(["check", "--static", good, bad, note]) == 1
    assert main(["check", "--static", "--ignore", "start-outside-limits", bad]) == 0
    capsys.readouterr()
    for arguments, words in (
        (["nowhere.fmu"], "No such file"),
        ([good, "--ignore", "nothing"], "no rule 'nothing'"),
        ([good, "--timeout", "-1"], "positive"),
        ([], "give the paths of FMUs to check"),
        ([good, "--static", "-o", "no/such/folder"], "no/such/folder"),
    ):
        assert main(["check", *arguments]) == 2
        captured = capsys.readouterr()
        assert words in captured.err
        assert captured.out == ""


def test_text(fmus: tuple[str, str, str], capsys: pytest.CaptureFixture[str]) -> None:
    good, bad, note = fmus
    main(["check", "--static", good, bad, note])
    (finding,) = check(bad, static=True)
    expected = (
        "good.fmu: conforms to every rule that was checked\n"
        f"bad one.fmu: modelDescription.xml:{finding.line}: error [start-outside-limits] Fc starts at -1, below its "
        "min 1e-09; choose a value inside the limits (FMI 2.0.5, 2.2.7)\n"
        "bad one.fmu: does not conform to the standard: 1 error\n"
        "note.fmu: notes.txt: note [file-unknown] the standard does not define 'notes.txt'; move it to resources "
        "or extra (FMI 2.0.5, 2.3)\n"
        "note.fmu: conforms to every rule that was checked: 1 note\n"
    )
    assert capsys.readouterr().out == expected
    main(["check", "--static", good, bad, note, "-o", "report.txt"])
    assert Path("report.txt").read_text(encoding="utf-8") == expected
    assert capsys.readouterr().out == ""


def test_json(fmus: tuple[str, str, str], capsys: pytest.CaptureFixture[str]) -> None:
    good, bad, _ = fmus
    assert main(["check", "--static", "--format", "json", good, bad]) == 1
    first, second = json.loads(capsys.readouterr().out)
    assert first == {"file": good, "findings": []}
    (finding,) = second["findings"]
    assert finding.pop("line") > 1
    assert finding == {
        "rule": "start-outside-limits",
        "severity": "error",
        "message": "Fc starts at -1, below its min 1e-09; choose a value inside the limits",
        "file": "modelDescription.xml",
        "variable": "Fc",
        "standard": "FMI 2.0.5",
    }


def test_sarif_follows_its_schema(fmus: tuple[str, str, str]) -> None:
    assert main(["check", "--static", "--format", "sarif", "-o", "report.sarif", *fmus]) == 1
    text = Path("report.sarif").read_text(encoding="utf-8")
    SarifLog.model_validate_json(text)  # generated from the schema, it knows no other members
    log = json.loads(text)
    assert log["version"] == "2.1.0"
    (run,) = log["runs"]
    rules, artifacts = run["tool"]["driver"]["rules"], run["artifacts"]
    assert [rule["id"] for rule in rules] == list(RULES)
    error, note = run["results"]
    assert (error["level"], note["level"]) == ("error", "note")
    for result, uri, inner in ((error, "bad%20one.fmu", "modelDescription.xml"), (note, "note.fmu", "notes.txt")):
        assert rules[result["ruleIndex"]]["id"] == result["ruleId"]
        outer = result["locations"][0]["physicalLocation"]["artifactLocation"]
        assert outer["uri"] == uri == artifacts[outer["index"]]["location"]["uri"]
        inside = result["relatedLocations"][0]["physicalLocation"]["artifactLocation"]
        assert inside["uri"] == inner == artifacts[inside["index"]]["location"]["uri"]
        assert artifacts[inside["index"]]["parentIndex"] == outer["index"]
    assert error["locations"][0]["logicalLocations"] == [{"name": "Fc", "kind": "member"}]
    assert error["relatedLocations"][0]["physicalLocation"]["region"]["startLine"] > 1


def test_rules_are_listed(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("friction_fmus.cli.console.console.width", 200)
    assert main(["check", "--rules"]) == 0
    shown = capsys.readouterr().out.splitlines()[1:]
    assert [line.split()[:3] for line in shown] == [[rule.id, rule.severity, rule.section] for rule in RULES.values()]


def test_a_rule_is_one_sentence() -> None:
    for rule in RULES.values():
        assert rule.summary.endswith(".") and ". " not in rule.summary
        assert rule.section.split(".")[0] in ("2", "3", "4") or rule.kind == "ssp"
