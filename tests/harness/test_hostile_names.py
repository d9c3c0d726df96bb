"""Names and units with characters that mean something to a file format, a plot or a terminal."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from harness import CallablePart, Port, System, load_result, plot, save_result
from harness.errors import HarnessError, SystemFileError


def result_of(names: dict[str, str | None]) -> xr.Dataset:
    time = np.arange(3.0)
    columns = {name: ("time", time, {} if unit is None else {"units": unit}) for name, unit in names.items()}
    return xr.Dataset(columns, coords={"time": ("time", time, {"units": "s"})})


@pytest.mark.parametrize("suffix", ["csv", "mat", "nc", "parquet"])
def test_files_keep_names_that_look_like_units_or_formulas(tmp_path: Path, suffix: str) -> None:
    names = {"p.x [mm]": None, "p.y [m]": "rad", "=cmd|'C'!A0": "m", "'=z": None, 'a,"b;': "N", "\u202ec": None}
    before = result_of(names)
    save_result(before, tmp_path / f"r.{suffix}")
    after = load_result(tmp_path / f"r.{suffix}")
    found = {str(name): column.attrs.get("units") for name, column in after.data_vars.items()}
    assert {name: unit or None for name, unit in found.items()} == names
    if suffix == "csv":
        assert all(cell[0] not in "=+-@" for cell in (tmp_path / "r.csv").read_text().split("\n")[0].split(","))


def test_a_plot_shows_names_and_units_literally(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: seen.append(figure))
    plot(result_of({"_a.x": "$\\frac{$", "b.$x$": "$\\frac{$", "c.y": "$N$"}), tmp_path / "plot.svg")
    both, single = seen[0].axes
    legend = both.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == ["_a.x", r"b.\$x\$"]
    assert (both.get_ylabel(), single.get_ylabel()) == (r"[\$\frac{\$]", r"c.y [\$N\$]")


@pytest.mark.parametrize("name", ["a\nb", "a\0b", "\x1b[2J", "a\x7f", "\ud800"])
def test_the_name_of_a_port_is_one_line(name: str) -> None:
    with pytest.raises(HarnessError, match="control characters"):
        CallablePart("p", lambda *_: 0.0, outputs=[name])


def test_a_system_file_is_not_written_with_connections_that_it_cannot_hold(tmp_path: Path) -> None:
    source = CallablePart("a -> b", lambda *_: 0.0, outputs=[Port("y")])
    target = CallablePart("c", lambda *_: 0.0, inputs=[Port("u")], outputs=[Port("z")])
    system = System([source, target], [("a -> b.y", "c.u")])
    path = tmp_path / "system.toml"
    with pytest.raises(SystemFileError, match="cannot be written"):
        system.to_toml(path)
    assert not path.exists()
