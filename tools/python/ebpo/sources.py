"""Sources of bytes: paths, URLs, bytes in memory, file objects, objects with ranges, fsspec."""
from __future__ import annotations

import ctypes
import functools
import io
import os
import stat
import threading
import weakref
from typing import Any, Mapping

import numpy as np

from . import _declared as c
from ._checked import members_of, path, text, within
from ._library import Handle, call, error_of, made, of_members, size_in_bytes
from .errors import ArgumentError, Error, IOFailure, UnsupportedError
from .ranges import CONNECTIONS, Ranges, read_whole
from .web import Patience, Web

FUNCTIONS: dict = dict(members_of(c.ebpo_source))
RANGE = np.dtype(c.ebpo_range)
IO, CANCELLED = -3, -9


class Seekable:
    """A file object with seek and read. One thread reads at a time."""

    def __init__(self, file: Any) -> None:
        self.file, self.lock = file, threading.Lock()
        self.size = file.seek(0, os.SEEK_END)
        if self.size is None:
            self.size = file.tell()

    def read_range(self, offset: int, size: int) -> bytes:
        with self.lock:
            self.file.seek(offset)
            data = self.file.read(size)
            while data and len(data) < size:  # a raw file may return fewer bytes than requested
                more = self.file.read(size - len(data))
                if not more:
                    break
                data += more
        return data


class Positioned:
    """A file that the operating system reads. The position of the file object is neither used nor changed."""

    def __init__(self, file: Any) -> None:
        self.file, self.size = file, os.fstat(file.fileno()).st_size

    @staticmethod
    def fits(file: Any) -> bool:
        """Return True for unmodified bytes of a regular file. Other files, such as GzipFile, may have a fileno() too."""
        raw = getattr(file, "raw", None) if type(file) in (io.BufferedReader, io.BufferedRandom) else file
        return hasattr(os, "pread") and type(raw) is io.FileIO and stat.S_ISREG(os.fstat(raw.fileno()).st_mode)

    def read_range(self, offset: int, size: int) -> bytes:
        parts = []
        while size and (data := os.pread(self.file.fileno(), size, offset)):
            parts.append(data)
            offset, size = offset + len(data), size - len(data)
        return b"".join(parts)


class Stored:
    """A path of an fsspec file system, read by ranges."""

    def __init__(self, url: str, storage_options: Mapping[str, Any] | None = None) -> None:
        try:
            import fsspec  # type: ignore[import-not-found, import-untyped, unused-ignore]
        except ImportError:
            raise ImportError(f"{url}: this kind of URL needs fsspec, which is not installed") from None
        self.fs, self.path = fsspec.core.url_to_fs(url, **(storage_options or {}))
        self.size = self.fs.size(self.path)

    def read_range(self, offset: int, size: int) -> bytes:
        return self.fs.cat_file(self.path, start=offset, end=offset + size)


class Uncached:
    """A file object of fsspec, read without its cache, which reads ahead. Several ranges are read at a time."""

    def __init__(self, file: Any) -> None:
        self.file, self.size = file, file.size

    @staticmethod
    def fits(file: Any) -> bool:
        return callable(getattr(getattr(file, "cache", None), "fetcher", None)) and isinstance(file.size, int)

    def read_range(self, offset: int, size: int) -> bytes:
        return self.file.cache.fetcher(offset, offset + size)


class Source:
    """An object with `size` and `read_range`, as an ebpo_source of the library.

    Only a Ranges receives prefetch hints.
    """

    def __init__(self, ranges: Any) -> None:
        self.ranges, self.interrupted = ranges, False
        far: Any = {}
        if isinstance(ranges, Ranges):
            far = {"prefetch": FUNCTIONS["prefetch"](self.prefetch), "prefetched": len(ranges.head)}
        self.struct = made(c.ebpo_source, size=ranges.size, read=FUNCTIONS["read"](self.read),
                           close=FUNCTIONS["close"](self.close), **far)

    def read(self, _user: int, offset: int, size: int, data: int, error: int) -> int:
        try:
            if self.interrupted:
                raise KeyboardInterrupt
            given = read_whole(self.ranges, offset, size)
            ctypes.memmove(data, np.frombuffer(given, np.uint8).ctypes.data, size)
            return 0
        except BaseException as raised:
            status = CANCELLED if isinstance(raised, KeyboardInterrupt) else IO
            if error:
                out = c.ebpo_error.from_address(error)
                out.status, out.offset = status, offset
                said = str(raised) if isinstance(raised, Error) else f"reading failed: {type(raised).__name__}: {raised}"
                out.message = shown(said)[:400]
            return status

    def prefetch(self, _user: int, ranges: int, count: int) -> None:
        try:
            self.ranges.prefetch(np.frombuffer(ctypes.string_at(ranges, count * RANGE.itemsize), RANGE).tolist())
        except KeyboardInterrupt:
            self.interrupted = True  # the next read raises KeyboardInterrupt
        except Exception:
            pass  # hints are optional

    def close(self, _user: int) -> None:
        if isinstance(self.ranges, Ranges):
            self.ranges.close()


def shown(name: str) -> bytes:
    """Return a text for messages as UTF-8 without NULs."""
    return name.encode("utf-8", "replace").replace(b"\0", b"?")


def http_options(options: dict) -> tuple[Any, list]:
    """Return the options of URLs as a struct, and the objects that must stay alive with it."""
    given, keep, own = {}, [], {}
    for name, value in options.items():
        if name == "headers":
            lines = [text(f"{key}: {value}", "headers") for key, value in value.items()] + [None]
            keep.append((ctypes.c_char_p * len(lines))(*lines))
            own["headers"] = ctypes.addressof(keep[-1])
        elif name in ("memory", "whole_limit", "cache_bytes"):
            given[name] = size_in_bytes(value)
        else:
            given[name] = path(value, name) if name in ("cache_folder", "ca_file") and value is not None else value
    return of_members(c.ebpo_http_options, given, **own), keep


def by_name(name: Any, max_expansion: int, keep: tuple = (), **members: Any) -> Handle:
    options = made(c.ebpo_open_options, max_expansion=max_expansion,
                   **{member: ctypes.addressof(struct) for member, struct in members.items()})
    return Handle.made("ebpo_open_with", name, ctypes.byref(options), free="ebpo_close", keep=keep)


@functools.lru_cache(1)
def has_http() -> bool:
    """Return True if the library has HTTP.

    A library without HTTP refuses every URL (UnsupportedError). A library with HTTP refuses only the invalid
    URL that is used here (ArgumentError).
    """
    try:
        call("ebpo_source_of_url", "no URL", None, ctypes.byref(made(c.ebpo_source)))
    except UnsupportedError:
        return False
    except ArgumentError:
        pass
    return True


def by_url(url: str, http: dict, max_expansion: int) -> Handle:
    struct, keep = http_options(http)
    own = {"headers", "time_limit", "retries", "whole_limit", "unversioned", "connections"}
    if has_http() or set(http) - own:  # the library supports other options, or refuses them without HTTP
        return by_name(url, max_expansion, http=struct)
    del keep
    connections = within(struct.connections if "connections" in http else CONNECTIONS, 1, 32, "connections")
    web = Web(url, **{name: value for name, value in http.items() if name != "connections"})
    return by_ranges(far(web, web.size, web.shown, connections=connections), web.shown, max_expansion)


class ByUrl:
    """A URL whose ranges are fetched together."""

    def __init__(self, url: str, http: dict) -> None:
        struct, self.keep = http_options(http)
        self.source = made(c.ebpo_source)
        if has_http():
            call("ebpo_source_of_url", url, ctypes.byref(struct), ctypes.byref(self.source))
        else:
            web = Web(url, **{name: value for name, value in http.items() if name != "connections"})
            self.keep = [Source(far(web, web.size, web.shown))]
            self.source = self.keep[0].struct
        self.size = self.source.size
        self._end = weakref.finalize(self, self.source.close, self.source.user)

    def fetch(self, ranges: list[tuple[int, int]]) -> list[np.ndarray]:
        """Return the bytes of ranges, which are requested at the same time."""
        hints, out = np.array(ranges, RANGE), []
        self.source.prefetch(self.source.user, hints.ctypes.data, len(hints))
        for offset, size in ranges:
            data, error = np.empty(size, np.uint8), made(c.ebpo_error)
            status = self.source.read(self.source.user, offset, size, data.ctypes.data, ctypes.addressof(error))
            if status:
                error.status = status
                raise error_of(error)
            out.append(data)
        return out


def by_ranges(ranges: Any, name: str, max_expansion: int = 0) -> Handle:
    """Open a Ranges, or an object with `size` and `read_range` on this machine."""
    source = Source(ranges)
    return by_name(shown(name), max_expansion, keep=(source,), source=source.struct)


def opened(source: Any, http: dict[str, Any], storage_options: Mapping[str, Any] | None,
           max_expansion: int = 0) -> Handle:
    """Return an open ebpo_file of any source that `ebpo.open` supports."""
    if hasattr(source, "async_source"):
        return by_name(shown(source.name), max_expansion, keep=(source,), source=source.async_source())
    if isinstance(source, (str, os.PathLike)):
        name = os.fspath(source)
        if isinstance(name, str) and name.startswith(("http://", "https://")) and storage_options is None:
            return by_url(name, http, max_expansion)
        if http:
            raise TypeError(f"{name} is not a URL; remove the options {', '.join(http)}")
        if isinstance(name, str) and "://" in name:
            stored = Stored(name, storage_options)
            return by_ranges(far(stored, stored.size, name), name, max_expansion)
        return by_name(path(name), max_expansion)
    if http or storage_options is not None:
        raise TypeError("options for URLs need a URL")
    name = str(getattr(source, "name", "") or type(source).__name__)
    if hasattr(source, "read_range") and hasattr(source, "size"):
        return by_ranges(far(source, source.size() if callable(source.size) else source.size, name), name,
                         max_expansion)
    if hasattr(source, "seek") and hasattr(source, "read") and not isinstance(source, _mmap()):
        return by_ranges(of_file(source, name), name, max_expansion)
    try:
        data = np.frombuffer(source, np.uint8)
    except (TypeError, ValueError):
        raise TypeError(f"{type(source).__name__} is neither a path, a URL, bytes, a file with seek and read nor "
                        "an object with size and read_range(offset, size)") from None
    if max_expansion:
        return by_ranges(Bytes(data), name, max_expansion)
    return Handle.made("ebpo_open_memory", data.ctypes.data, data.nbytes, shown(name), free="ebpo_close",
                       keep=(data, source))


def far(source: Any, size: Any, name: str, **options: Any) -> Ranges:
    """Return a Ranges of a source elsewhere. Reads its first bytes; raises IOFailure when that fails."""
    try:
        return Ranges(source, size_in_bytes(size), **options)
    except (Error, TypeError):
        raise
    except Exception as error:
        raise IOFailure(f"{name}: reading failed: {type(error).__name__}: {error}", "EBPO_E_IO", name) from error


def of_file(file: Any, name: str) -> Any:
    """Return a reader of a file object: a Seekable on this machine, else a Ranges."""
    if Uncached.fits(file):
        return far(Uncached(file), file.size, name)
    if Positioned.fits(file):
        return Positioned(file)
    seekable = Seekable(file)
    if isinstance(file, io.BytesIO) or is_of_system(file):
        return seekable
    return far(seekable, seekable.size, name, connections=1)


def is_of_system(file: Any) -> bool:
    """Return True for files that the operating system reads."""
    try:
        return isinstance(file.fileno(), int)
    except (AttributeError, OSError):
        return False


class Bytes:
    """Bytes in memory, with `size` and `read_range`."""

    def __init__(self, data: np.ndarray) -> None:
        self.data, self.size = data, data.nbytes

    def read_range(self, offset: int, size: int) -> memoryview:
        return self.data[offset:offset + size].data


def _mmap() -> type:
    """Return the type of memory maps, which have seek and read but are used as bytes."""
    import mmap
    return mmap.mmap


__all__ = ["Patience", "Seekable", "Stored", "Web", "opened"]
