"""Exceptions. Each failure of the library is one of these classes, with the library's message.

The message states what is wrong, where, and what to do. The classes derive from the corresponding classes
of Python, so `except OSError` catches failures of the system or of a server, and `except FileNotFoundError`
files that do not exist.
"""
from __future__ import annotations

import errno
from typing import Any

__all__ = ["Error", "ArgumentError", "IOFailure", "FormatError", "VersionError", "UnsupportedError",
           "NotSolidError", "LimitError", "Cancelled", "AbsentError", "NoMemory",
           "MissingFileError", "FileAccessError", "FolderError", "ExistingFileError"]


class Error(Exception):
    """A failure of the library.

    status: the name of the C status, such as "EBPO_E_FORMAT".
    file: the file with the fault, or "".
    object: the path inside the file, or "".
    offset: the offset of the fault in bytes, or None.
    """

    status: str = ""
    file: str = ""
    object: str = ""
    offset: int | None = None

    def __init__(self, message: str = "", status: str = "", file: str = "", object: str = "",
                 offset: int | None = None) -> None:
        super().__init__(message)
        self.status, self.file, self.object, self.offset = status, file, object, offset

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.status, self.file, self.object, self.offset)

    def __str__(self) -> str:
        return str(self.args[0]) if self.args else ""


class ArgumentError(Error, ValueError):
    """An argument is invalid: for example a point that is not finite, or a level that does not exist."""


class IOFailure(Error, OSError):
    """The system, a server or a source of bytes reported a failure.

    errno: the system's error number, or None. filename: the file, or None.
    """

    ERRNO: int | None = None

    def __init__(self, message: str = "", status: str = "EBPO_E_IO", file: str = "", object: str = "",
                 offset: int | None = None) -> None:
        super().__init__(message, status, file, object, offset)
        self.errno, self.filename = self.ERRNO, file or None


class MissingFileError(IOFailure, FileNotFoundError):
    """A file or folder does not exist, also on a web server."""

    ERRNO = errno.ENOENT


class FileAccessError(IOFailure, PermissionError):
    """The system does not permit to use a file."""

    ERRNO = errno.EACCES


class FolderError(IOFailure, IsADirectoryError):
    """A file is expected, and the path names a folder."""

    ERRNO = errno.EISDIR


class ExistingFileError(IOFailure, FileExistsError):
    """An output file exists, and replacing it was not requested."""

    ERRNO = errno.EEXIST


class FormatError(Error, ValueError):
    """A file violates its format or is damaged."""


class VersionError(Error, ValueError):
    """A file needs a newer reader."""


class UnsupportedError(Error, NotImplementedError):
    """The request is valid, but this build of the library does not support it."""


class NotSolidError(Error, ValueError):
    """A solid is required, and the model is a surface."""


class LimitError(Error, ValueError):
    """A count or size exceeds a limit, or the budget is too small. The message states a sufficient budget."""


class Cancelled(Error):
    """A progress callback requested a stop."""


class AbsentError(Error, LookupError):
    """The file was written without a part that the query needs."""


class Pending(Error):
    """Bytes of the file have not arrived. `AsyncModel` fetches them and repeats the call."""


class NoMemory(Error, MemoryError):
    """An allocation failed."""


BY_ERRNO: dict[int, type[IOFailure]] = {
    errno.ENOENT: MissingFileError, errno.EACCES: FileAccessError, errno.EPERM: FileAccessError,
    errno.EISDIR: FolderError, errno.EEXIST: ExistingFileError}

BY_STATUS: dict[int, type[Error]] = {
    -1: NoMemory, -2: ArgumentError, -3: IOFailure, -4: FormatError, -5: VersionError, -6: UnsupportedError,
    -7: NotSolidError, -8: LimitError, -9: Cancelled, -10: AbsentError, -11: Pending}
