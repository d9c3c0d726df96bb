"""The .ssp archive (SSP 1.0, chapter 3)."""

from __future__ import annotations

import io
import shutil
import tempfile
import weakref
import zipfile
from pathlib import Path, PurePosixPath
from types import TracebackType
from typing import Final, Self
from urllib.parse import unquote, urlsplit

from lxml import etree

from harness.archive import find_outside
from harness.atomic import atomic_path
from harness.errors import OutputError, SystemFileError
from harness.files import require_regular

#: The member that describes the system.
SSD_NAME: Final = "SystemStructure.ssd"


class Package:
    """An archive that is being read.

    Parameters
    ----------
    path : Path
        The .ssp file.

    Raises
    ------
    SystemFileError
        If the file is missing, is no such archive, or has members that would be written outside of the folder it is
        unpacked to.
    """

    def __init__(self, path: Path) -> None:
        """Open and check."""
        self.path = path
        try:
            require_regular(path)
            self._archive = zipfile.ZipFile(path)
        except OSError as error:
            raise SystemFileError(f"cannot open {path}: {error.strerror}; give the path of an .ssp file") from error
        except zipfile.BadZipFile as error:
            raise SystemFileError(f"{path} is not an SSP: it is not a zip archive; export it again") from error
        members = self._archive.namelist()
        try:
            outside = find_outside(members)
            if outside is not None:
                raise SystemFileError(
                    f"{path} was not unpacked: its member '{outside}' points outside of it; do not use this file"
                )
            if SSD_NAME not in members:
                raise SystemFileError(f"{path} is not an SSP: it has no {SSD_NAME}; export it again")
        except SystemFileError:
            self._archive.close()
            raise

    def __enter__(self) -> Self:
        """Return the package; leaving the block closes it."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Close the archive."""
        self._archive.close()

    def read(self, member: str, where: str) -> bytes:
        """Content of a member.

        Raises
        ------
        SystemFileError
            If there is no such member, or it is damaged.
        """
        return _read(self._archive, member, where)

    def referenced(self, element: etree._Element, component: etree._Element | None, where: str) -> tuple[bytes, str]:
        """Content and name of the file that the attribute ``source`` of an element names.

        Parameters
        ----------
        element : lxml element
            The reference; with ``sourceBase="component"`` the file is in the FMU.
        component : lxml element or None
            The component that the reference belongs to, if it does.
        where : str
            The reference, for messages.

        Raises
        ------
        SystemFileError
            If the file is not in the archive.
        """
        source = member_name(element.get("source"), where)
        if element.get("sourceBase", "SSD") == "SSD":
            return self.read(source, where), f"{source} in {self.path}"
        if component is None:
            raise SystemFileError(f"{where} names a file in a component, but belongs to a system: move the file")
        fmu = self.read(member_name(component.get("source"), where), where)
        try:
            with zipfile.ZipFile(io.BytesIO(fmu)) as archive:
                return _read(archive, source, where), f"{source} in an FMU of {self.path}"
        except zipfile.BadZipFile as error:
            raise SystemFileError(
                f"{where} names a file in an FMU that is not a zip archive: export it again"
            ) from error

    def unpack(self, member: str, folder: Path, where: str) -> Path:
        """Write a member to the same place below a folder and return its path.

        Raises
        ------
        SystemFileError
            If there is no such member.
        OutputError
            If it cannot be written.
        """
        data, target = self.read(member, where), folder / member
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"cannot make the folder {target.parent}: {error.strerror}; give another one") from error
        with atomic_path(target) as temporary:
            temporary.write_bytes(data)
        return target


class TemporaryFolder:
    """A folder that vanishes with the last reference to this object.

    Attributes
    ----------
    path : Path
        The folder.
    """

    def __init__(self) -> None:
        """Make the folder."""
        self.path = Path(tempfile.mkdtemp(prefix="harness-ssp-"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


def member_name(source: str | None, where: str) -> str:
    """The member of the archive that a relative URI names.

    Raises
    ------
    SystemFileError
        If it names something else.
    """
    parts = urlsplit(source or "")
    name = str(PurePosixPath(unquote(parts.path)))
    if parts.scheme or parts.netloc or parts.query or parts.fragment or not parts.path or find_outside([name]):
        raise SystemFileError(f"{where} names '{source}', which is no file in the archive: pack the file into it")
    return name


def write_package(path: Path, members: dict[str, bytes | Path]) -> None:
    """Write an archive; the same members give the same bytes.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    with atomic_path(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, content in members.items():
            entry = zipfile.ZipInfo(name)  # of 1980, always
            entry.create_system = 3
            entry.external_attr = 0o644 << 16
            # an FMU is compressed already
            entry.compress_type = zipfile.ZIP_STORED if isinstance(content, Path) else zipfile.ZIP_DEFLATED
            archive.writestr(entry, content.read_bytes() if isinstance(content, Path) else content)


def _read(archive: zipfile.ZipFile, member: str, where: str) -> bytes:
    try:
        return archive.read(member)
    except KeyError as error:
        raise SystemFileError(f"{where} names '{member}', which is not in the archive: pack it into it") from error
    except (zipfile.BadZipFile, RuntimeError, NotImplementedError, OSError) as error:
        raise SystemFileError(f"{where} names '{member}', which cannot be read ({error}): pack it again") from error
