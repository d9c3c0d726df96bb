"""Extras: what the parts of the package need beyond what it always installs."""

from __future__ import annotations

import sys
import types
from pathlib import Path

import pytest
from hatchling.builders.wheel import WheelBuilder
from packaging.requirements import Requirement

from friction_fmus.cli.commands import study
from friction_fmus.cli.main import main
from harness import MissingPackageError, extras
from harness.extras import extra_of, lazy_names, require

ROOT = Path(__file__).parents[2]
EXTRAS = {
    **dict.fromkeys(("casadi", "ziglang"), "build"),
    "plotly": "study",
    **{"distributed": "dask", "mcap": "mcap", "pyarrow": "parquet"},
}
"""Package -> the extra that a message names."""


@pytest.fixture(scope="module")
def declared() -> dict[str, set[str]]:
    """Name of each extra -> packages that it installs; the name "" stands for no extra."""
    core = WheelBuilder(str(ROOT)).metadata.core
    groups = {"": core.dependencies, **core.optional_dependencies}
    return {name: {Requirement(text).name for text in texts} for name, texts in groups.items()}


def test_each_extra_installs_what_its_message_promises(declared: dict[str, set[str]]) -> None:
    for package, extra in EXTRAS.items():
        assert extra_of(package) == extra
        assert package in declared[extra]
        assert package in declared["all"]
        assert package not in declared[""]
    assert extra_of("numpy") is None and extra_of("colours") is None


def test_the_study_gets_all_that_it_needs(declared: dict[str, set[str]]) -> None:
    assert declared["study"] >= declared["build"] | {"plotly"}


def test_an_editable_install_gets_what_a_study_needs(declared: dict[str, set[str]], tmp_path: Path) -> None:
    """It compiles its FMUs, and the main command of README studies an axis in a checkout."""
    hook = WheelBuilder(str(ROOT)).get_build_hooks(str(tmp_path))["custom"]
    data: dict[str, list[str]] = {"dependencies": []}
    hook.initialize("editable", data)
    assert {Requirement(text).name for text in data["dependencies"]} == declared["study"]


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> None:
    """No package of an extra is found."""
    monkeypatch.setattr(extras, "find_spec", lambda package: None)


@pytest.mark.parametrize("package", EXTRAS)
@pytest.mark.usefixtures("without")
def test_a_missing_package_is_one_sentence(package: str) -> None:
    with pytest.raises(MissingPackageError) as caught:
        require(package, "a law needs it")
    assert str(caught.value).startswith(f"{package} is not installed; a law needs it")
    assert str(caught.value).endswith(f": pip install 'friction-fmus[{EXTRAS[package]}]'")
    assert isinstance(caught.value, ModuleNotFoundError)
    assert caught.value.name == package


@pytest.mark.usefixtures("without")
def test_a_command_ends_with_this_sentence(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["study", "demo", "-o", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.endswith("the report of a study needs it: pip install 'friction-fmus[study]'\n")


@pytest.mark.parametrize(("name", "status"), [("casadi", 2), ("colours", None)])
def test_an_import_that_fails_in_a_command(
    name: str, status: int | None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(options: object) -> None:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr(study, "run", run)
    if status is None:
        with pytest.raises(ModuleNotFoundError, match="colours"):
            main(["study", "demo", "-o", "out"])
    else:
        assert main(["study", "demo", "-o", "out"]) == status
        assert "`friction-fmus study` needs it: pip install 'friction-fmus[build]'" in capsys.readouterr().err


def test_a_public_name_of_a_module_that_needs_an_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "needy.py").write_text("import pyarrow\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    package = types.ModuleType("package")
    package.__file__ = str(tmp_path / "package.py")
    (tmp_path / "package.py").write_text("if TYPE_CHECKING:\n    from needy import read\n")
    monkeypatch.setitem(sys.modules, "package", package)
    getter, _ = lazy_names("package")
    with pytest.raises(
        MissingPackageError, match=r"pyarrow is not installed; read needs it: pip install 'friction-fmus\[parquet\]'"
    ):
        getter("read")
