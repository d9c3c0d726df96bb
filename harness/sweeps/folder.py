"""The folder of a sweep: its description, and Parquet files of the completed runs."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.dataset as pds
import pyarrow.parquet as pq
import xarray as xr
from numpy.typing import NDArray

from harness.errors import SweepError
from harness.parts.part import PortType
from harness.result import DTYPES
from harness.storage.files import atomic_path, make_folder, reason
from harness.sweeps.columns import Columns
from harness.sweeps.samples import Sample
from harness.sweeps.worker import Outcome

MANIFEST: Final = "_sweep.json"  # readers of Parquet datasets ignore files that begin with an underscore

TRAJECTORIES: Final = "_trajectories"
FORMAT: Final = 1

_TYPES: Final[dict[PortType, Any]] = {
    "Real": pa.float64(),
    "Integer": pa.int64(),
    "Boolean": pa.bool_(),
    "String": pa.string(),
}
_FORMAT: Final = pds.ParquetFileFormat(
    default_fragment_scan_options=pds.ParquetFragmentScanOptions(page_checksum_verification=True)
)


class SweepFolder:
    """A sweep on disk."""

    def __init__(
        self,
        path: Path,
        description: Mapping[str, Any],
        parameters: Mapping[str, PortType],
        units: Mapping[str, str],
        kept: Mapping[str, PortType] = MappingProxyType({}),
    ) -> None:
        """Begin a sweep, or find the completed runs of an interrupted one."""
        self.path = path
        self._columns = Columns(parameters, units)
        self._kept = kept
        description = json.loads(json.dumps({"format": FORMAT, **description}))
        self._description = description
        manifest = path / MANIFEST
        if manifest.is_file() and self._files():
            found = read_manifest(path)
            self._columns.measures = found.pop("measured")
            found.pop("parameters")
            different = sorted(key for key in {*found, *description} if found.get(key) != description.get(key))
            if different:
                raise SweepError(
                    f"{path} contains another sweep, which differs in {', '.join(different)}: give another folder or "
                    "remove it"
                )
        elif not manifest.is_file() and any(not entry.name.startswith(".") for entry in path.iterdir()):
            raise SweepError(f"{path} contains files but no sweep: give a new or an empty folder")
        else:  # a sweep without completed runs can be replaced
            self._write_manifest()
        for left in path.rglob(".*.parquet"):  # left by a process that was killed while writing
            left.unlink(missing_ok=True)
        written = {file.name for file in self._files()}
        for left in (path / TRAJECTORIES).glob("runs-*.parquet"):
            if left.name not in written:  # the process was killed before it wrote the table of these runs
                left.unlink(missing_ok=True)
        self.done = self._runs_done(int(description["runs"]))  # numbers of the completed runs

    def add(self, outcomes: Sequence[Outcome], samples: Sequence[Sample]) -> None:
        """Write the outcomes of some runs to one file, completely or not at all."""
        if not outcomes:
            return
        if self._columns.begin(outcomes):
            self._extend()
        name = f"runs-{outcomes[0].run:08d}-{len(outcomes)}.parquet"
        kept = [outcome for outcome in outcomes if outcome.kept is not None]
        if kept:
            (self.path / TRAJECTORIES).mkdir(exist_ok=True)
            self._write(_trajectories(kept, self._kept), self.path / TRAJECTORIES / name)
        values = self._columns.values(outcomes, samples)
        columns = {column: pa.array(cells, _TYPES[kind]) for column, (kind, cells) in values.items()}
        units = self._columns.units
        fields = [
            pa.field(column, array.type, metadata={"units": units[column]} if column in units else None)
            for column, array in columns.items()
        ]
        self._write(pa.Table.from_arrays(list(columns.values()), schema=pa.schema(fields)), self.path / name)
        self.done.update(outcome.run for outcome in outcomes)

    def read(self) -> xr.Dataset:
        """Return the completed runs, see `read_sweep`."""
        return read_sweep(self.path)

    def _extend(self) -> None:
        """Add the columns of the measures to the files of runs that failed before the first measured one."""
        for file in self._files():
            table = _read(file)
            # a process killed here may have left some files with these columns
            for place, name in enumerate(self._columns.measures or (), 1 + len(self._columns.parameters)):
                if name not in table.column_names:
                    table = table.add_column(place, name, pa.nulls(len(table), pa.float64()))
            self._write(table, file)
        self._write_manifest()

    def _write_manifest(self) -> None:
        content = {
            **self._description,
            "parameters": list(self._columns.parameters),
            "measured": self._columns.measures,
        }
        with atomic_path(self.path / MANIFEST) as temporary:
            temporary.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")

    def _write(self, table: Any, path: Path) -> None:
        with atomic_path(path) as temporary:
            pq.write_table(table, temporary, write_page_checksum=True)

    def _files(self) -> list[Path]:
        return sorted(self.path.glob("runs-*.parquet"))

    def _runs_done(self, count: int) -> set[int]:
        """Return the numbers of the runs in all files, after checking that none is damaged or repeated."""
        done: set[int] = set()
        needed = {"run", *self._columns.parameters, "wall_time", "error", "warnings"}
        for file in self._files():
            table = _read(file)
            if missing := needed - set(table.column_names):
                raise SweepError(_damage(file, f"it has no column {min(missing)}"))
            runs = table["run"].to_pylist()
            if not all(type(run) is int and 0 <= run < count for run in runs):
                raise SweepError(_damage(file, f"its runs are not numbers from 0 to {count - 1}"))
            if len({*runs}) < len(runs) or not done.isdisjoint(runs):
                raise SweepError(_damage(file, "it repeats a run of another file"))
            done.update(runs)
        return done


def _read(path: Path) -> Any:
    """Return the table in a file after checking the checksums of its pages."""
    try:
        return pq.ParquetFile(path, page_checksum_verification=True).read()
    except (OSError, pa.ArrowException, ValueError) as error:
        raise SweepError(_damage(path, reason(error))) from error


def _damage(path: Path, why: str) -> str:
    return f"cannot read {path}: {why}; remove it to repeat its runs"


def read_manifest(path: Path) -> dict[str, Any]:
    """Return the description of the sweep in a folder."""
    try:
        content = json.loads((path / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise SweepError(f"{path} contains no sweep: {error}; give the folder of a sweep") from error
    known = content if isinstance(content, dict) else {}
    if not _names(known.get("parameters")) or not (known.get("measured", 0) is None or _names(known.get("measured"))):
        raise SweepError(f"{path / MANIFEST} is damaged: parameters and measures are missing; remove the folder")
    return known


def _names(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(name, str) for name in value)


def read_sweep(folder: str | Path) -> xr.Dataset:
    """Read the completed runs of a sweep.

    Parameters
    ----------
    folder : path-like
        The folder of the sweep.

    Returns
    -------
    xarray.Dataset
        Table along ``run``: the parameters as coordinates; the measures (NaN if missing), ``wall_time`` [s], ``error``
        and ``warnings`` (empty if there are none) as variables.

    Raises
    ------
    SweepError
        If the folder contains no sweep.
    """
    path = Path(folder)
    parameters = read_manifest(path)["parameters"]
    files = sorted(str(file) for file in path.glob("runs-*.parquet"))
    if not files:
        return xr.Dataset(coords={"run": np.array([], dtype=np.int64)})
    try:
        table = pds.dataset(files, format=_FORMAT).to_table().sort_by("run")
    except (OSError, pa.ArrowException, ValueError) as error:
        why = reason(error)
        raise SweepError(f"cannot read the runs in {path}: {why}; remove the damaged file and sweep again") from error
    if missing := {"run", *parameters} - set(table.column_names):
        raise SweepError(f"the runs in {path} have no column {min(missing)}: remove the folder and sweep again")
    columns = {}
    for field in table.schema:
        column = table[field.name]
        if field.type == pa.string():
            column = column.fill_null("")
        units = (field.metadata or {}).get(b"units", b"").decode()
        columns[field.name] = ("run", column.to_numpy(), {"units": units} if units else {})
    coordinates = {name: columns.pop(name) for name in ("run", *parameters)}
    return xr.Dataset(columns, coordinates)


def _trajectories(outcomes: Sequence[Outcome], kinds: Mapping[str, PortType]) -> Any:
    """Return the trajectories below each other, with the number of the run in the first column."""
    tables = []
    fields = None
    for outcome in outcomes:
        assert outcome.kept is not None
        columns = {str(name): outcome.kept[name] for name in ["time", *outcome.kept.data_vars]}
        arrays = [_array(column.to_numpy(), kinds.get(name, "Real")) for name, column in columns.items()]
        if fields is None:
            metadata = [{str(k): str(v) for k, v in column.attrs.items()} for column in columns.values()]
            types = [array.type for array in arrays]
            fields = [
                pa.field(name, kind, metadata=about) for name, kind, about in zip(columns, types, metadata, strict=True)
            ]
        run = pa.array(np.full(len(arrays[0]), outcome.run), pa.int64())
        tables.append(pa.Table.from_arrays([run, *arrays], schema=pa.schema([pa.field("run", pa.int64()), *fields])))
    return pa.concat_tables(tables)


def _array(values: NDArray[Any], kind: PortType) -> Any:
    """Return a column of the type of its variable in all runs; NaN in an Integer or a Boolean is null."""
    if kind == "Real":
        return pa.array(values)
    known = np.isfinite(values)
    return pa.array(np.where(known, values, 0).astype(DTYPES[kind]), mask=~known)


@contextmanager
def sole_writer(path: Path) -> Iterator[None]:
    """Make a folder and lock it against other processes; the lock ends with the process."""
    make_folder(path)
    try:
        import fcntl
    except ImportError:  # Windows has another kind of lock
        yield
        return
    with (path / ".lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise SweepError(f"another process is running the sweep in {path}: wait for it or end it") from error
        yield
