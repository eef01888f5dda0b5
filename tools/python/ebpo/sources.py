"""Where bytes come from: paths, URLs, bytes in memory, file objects, objects with ranges, fsspec."""
from __future__ import annotations

import ctypes
import datetime
import email.utils
import os
import random
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
from collections import OrderedDict
from http.client import HTTPException
from typing import Any

import numpy as np

from . import _declared as c
from ._library import Handle, made, size_in_bytes
from .errors import UnsupportedError

FUNCTIONS: dict = {name: kind for name, kind in c.ebpo_source._fields_}
IO, CANCELLED = -3, -9


class Seekable:
    """A file object with seek and read, one thread at a time."""

    def __init__(self, file: Any) -> None:
        self.file, self.lock = file, threading.Lock()
        self.size = file.seek(0, os.SEEK_END)
        if self.size is None:
            self.size = file.tell()

    def read_range(self, offset: int, size: int) -> bytes:
        with self.lock:
            self.file.seek(offset)
            data = self.file.read(size)
            while data and len(data) < size:  # raw files give what they have
                more = self.file.read(size - len(data))
                if not more:
                    break
                data += more
        return data


class Stored:
    """A path of an fsspec file system, read by ranges."""

    def __init__(self, url: str, storage_options: dict | None = None) -> None:
        try:
            import fsspec
        except ImportError:
            raise ImportError(f"{url}: this kind of address takes fsspec, which is not installed") from None
        self.fs, self.path = fsspec.core.url_to_fs(url, **(storage_options or {}))
        self.size = self.fs.size(self.path)

    def read_range(self, offset: int, size: int) -> bytes:
        return self.fs.cat_file(self.path, start=offset, end=offset + size)


class Redirects(urllib.request.HTTPRedirectHandler):
    """As the library follows them: five, http and https alone, never from https to http; the caller's
    headers, which may be secret, stay with the server that they were given for."""

    max_redirections = 5

    def redirect_request(self, request: Any, answer: Any, code: int, message: str, headers: Any, url: str) -> Any:
        new = super().redirect_request(request, answer, code, message, headers, url)
        before, after = urllib.parse.urlsplit(request.full_url), urllib.parse.urlsplit(url)
        if after.scheme not in ("http", "https") or (before.scheme, after.scheme) == ("https", "http"):
            raise OSError(f"the server leads from {before.scheme} to {after.scheme}, which is not followed")
        if (before.scheme, before.netloc.lower()) != (after.scheme, after.netloc.lower()):
            new.headers = {"Range": new.headers["Range"]}
        return new


OPENER = urllib.request.build_opener(Redirects)


class Patience:
    """How long a request is sent again: with pauses that double, by chance shorter, so that many clients do
    not come back together; or as long as the server says (Retry-After)."""

    FIRST, LONGEST, AGAIN = 0.2, 20.0, (408, 429, 500, 502, 503, 504)

    def __init__(self, seconds: float, retries: int | None, what: str) -> None:
        self.began, self.seconds, self.retries, self.what, self.failures = time.monotonic(), seconds, retries, what, 0

    def wait(self, error: Exception) -> None:
        """Before the next trial. Raises OSError if it would come too late, and `error` if it is no use."""
        code = getattr(error, "code", None)
        if code is not None and code not in self.AGAIN:
            raise error
        pause = min(self.LONGEST, self.FIRST * 2**min(self.failures, 16)) * random.uniform(0.5, 1)
        pause = max(pause, self.told(error))
        self.failures += 1
        gone = time.monotonic() - self.began
        if gone + pause > self.seconds or (self.retries is not None and self.failures > self.retries):
            said = f"status {code}" if code is not None else str(getattr(error, "reason", error))
            raise OSError(f"{self.what}: no answer after {self.failures} requests in {gone:.1f} s, the last one: "
                          f"{said}; {self.seconds:g} s (time_limit) and "
                          f"{'any number of' if self.retries is None else self.retries} retries are allowed") from error
        threading.Event().wait(pause)

    @staticmethod
    def told(error: Exception) -> float:
        """Seconds that a server asks for, as a number or a date; 0: none."""
        text = (getattr(error, "headers", None) or {}).get("Retry-After") or ""
        if text.strip().isdecimal():
            return float(text)
        try:
            then = email.utils.parsedate_to_datetime(text)
            return max(0.0, (then - datetime.datetime.now(datetime.timezone.utc)).total_seconds())
        except (TypeError, ValueError):
            return 0.0


class Web:
    """A URL by Python's own HTTP, where the library has none. Answers are of one version of the file.

    time_limit: seconds for a request with all that repeat it; retries: how many do at most, None: any number.
    One may be silent for SILENT seconds.
    """

    BLOCK, HELD, SILENT = 1 << 17, 384, 60.0

    def __init__(self, url: str, headers: dict | None = None, time_limit: float = 120.0,
                 retries: int | None = None) -> None:
        self.url, self.headers, self.lock = url, dict(headers or {}), threading.Lock()
        self.time_limit, self.retries = time_limit, retries
        self.blocks: OrderedDict[int, bytes] = OrderedDict()
        self.version: Any = None
        self.size = 0
        self.blocks[0] = self.fetch(0)

    def fetch(self, number: int) -> bytes:
        begin = number * self.BLOCK
        end = begin + self.BLOCK - 1
        if self.version is not None:
            end = min(end, self.size - 1)
        request = urllib.request.Request(self.url, headers={**self.headers, "Range": f"bytes={begin}-{end}"})
        patience = Patience(self.time_limit, self.retries, self.url.partition("?")[0])
        while True:
            try:
                with OPENER.open(request, timeout=min(self.SILENT, self.time_limit)) as answer:
                    return self.checked(answer, begin)
            except (urllib.error.URLError, TimeoutError, ConnectionError, HTTPException) as error:
                patience.wait(error)

    def checked(self, answer: Any, begin: int) -> bytes:
        if answer.status != 206:
            raise OSError(f"the server does not answer ranges (status {answer.status})")
        first, _, whole = (answer.headers["Content-Range"] or "").partition(" ")[2].partition("/")
        if not first.partition("-")[0].isdecimal() or not whole.isdecimal():
            raise OSError("the server does not say which range it sent")
        tag = (answer.headers["ETag"] or "").removeprefix("W/")  # of weak ones, too
        version = tag or answer.headers["Last-Modified"], whole
        if self.version not in (None, version):
            raise OSError("the file on the server has changed since it was opened")
        data = answer.read(self.BLOCK + 1)  # not more, however much a server sends
        self.version, self.size = version, int(whole)
        if int(first.partition("-")[0]) == begin and len(data) < min(self.BLOCK, self.size - begin):
            raise ConnectionError(f"the connection ended after {len(data)} bytes")
        if int(first.partition("-")[0]) != begin or len(data) != min(self.BLOCK, self.size - begin):
            raise OSError("the server sent another range than was asked for")
        return data

    def block(self, number: int) -> bytes:
        with self.lock:
            if number in self.blocks:
                self.blocks.move_to_end(number)
                return self.blocks[number]
        data = self.fetch(number)
        with self.lock:
            self.blocks[number] = data
            while len(self.blocks) > self.HELD:
                self.blocks.popitem(last=False)
        return data

    def read_range(self, offset: int, size: int) -> bytes:
        first, last = offset // self.BLOCK, (offset + size - 1) // self.BLOCK
        data = b"".join(map(self.block, range(first, last + 1)))
        return data[offset - first * self.BLOCK:][:size]


class Source:
    """An object with ranges as the library wants it."""

    def __init__(self, ranges: Any) -> None:
        self.ranges = ranges
        size = ranges.size
        self.struct = made(c.ebpo_source, size=size() if callable(size) else size,
                           read=FUNCTIONS["read"](self.read))

    def read(self, _user: int, offset: int, size: int, data: int, error: int) -> int:
        try:
            told = memoryview(self.ranges.read_range(offset, size)).cast("B")
            if len(told) != size:
                raise OSError(f"{len(told)} bytes came instead of {size} at byte {offset}")
            ctypes.memmove(data, np.frombuffer(told, np.uint8).ctypes.data, size)
            return 0
        except BaseException as raised:
            status = CANCELLED if isinstance(raised, KeyboardInterrupt) else IO
            if error:
                out = c.ebpo_error.from_address(error)
                out.status, out.offset = status, offset
                out.message = f"reading failed: {type(raised).__name__}: {raised}".encode()[:400]
            return status


def http_options(options: dict) -> tuple[Any, list]:
    """Options of URLs as the library takes them, and what must live as long."""
    struct, keep = made(c.ebpo_http_options), []
    for name, value in options.items():
        if name == "headers":
            lines = [f"{key}: {text}".encode() for key, text in value.items()] + [None]
            keep.append((ctypes.c_char_p * len(lines))(*lines))
            value = ctypes.addressof(keep[-1])
        elif name in ("memory", "whole_limit", "cache_bytes"):
            value = size_in_bytes(value)
        elif isinstance(value, (str, os.PathLike)):
            value = os.fsencode(value)
        known = dict(c.ebpo_http_options._fields_)
        if name not in known or name in ("struct_size", "stop", "stop_user", "reserved"):
            raise TypeError(f"there is no option {name!r} of URLs")
        setattr(struct, name, value)
    return struct, keep


def by_name(name: bytes, most_expansion: int, keep: tuple = (), **members: Any) -> Handle:
    options = made(c.ebpo_open_options, most_expansion=most_expansion,
                   **{member: ctypes.addressof(struct) for member, struct in members.items()})
    return Handle.made("ebpo_open_with", name, ctypes.byref(options), free="ebpo_close", keep=keep)


def by_url(url: str, http: dict, most_expansion: int) -> Handle:
    struct, keep = http_options(http)
    try:
        return by_name(url.encode(), most_expansion, http=struct)
    except UnsupportedError:
        if set(http) - {"headers", "time_limit", "retries"}:
            raise
    del keep
    return by_ranges(Web(url, **http), url.partition("?")[0], most_expansion)


def by_ranges(ranges: Any, name: str, most_expansion: int = 0) -> Handle:
    source = Source(ranges)
    return by_name(name.encode(), most_expansion, keep=(source,), source=source.struct)


def opened(source: Any, http: dict, storage_options: dict | None, most_expansion: int = 0) -> Handle:
    """An ebpo_file of whatever `ebpo.open` takes."""
    if isinstance(source, (str, os.PathLike)):
        name = os.fspath(source)
        if isinstance(name, str) and name.startswith(("http://", "https://")) and storage_options is None:
            return by_url(name, http, most_expansion)
        if http:
            raise TypeError(f"{name} is no URL: there is nothing to do for {', '.join(http)}")
        if isinstance(name, str) and "://" in name:
            return by_ranges(Stored(name, storage_options), name, most_expansion)
        return by_name(os.fsencode(name), most_expansion)
    if http or storage_options is not None:
        raise TypeError("options of URLs are for URLs")
    name = str(getattr(source, "name", "") or type(source).__name__)
    if hasattr(source, "read_range") and hasattr(source, "size"):
        return by_ranges(source, name, most_expansion)
    if hasattr(source, "seek") and hasattr(source, "read") and not isinstance(source, _mmap()):
        return by_ranges(Seekable(source), name, most_expansion)
    try:
        data = np.frombuffer(source, np.uint8)
    except (TypeError, ValueError):
        raise TypeError(f"{type(source).__name__} is neither a path, a URL, bytes, a file with seek and read nor "
                        "an object with size and read_range(offset, size)") from None
    if most_expansion:
        return by_ranges(Bytes(data), name, most_expansion)
    return Handle.made("ebpo_open_memory", data.ctypes.data, data.nbytes, name.encode(), free="ebpo_close",
                       keep=(data, source))


class Bytes:
    """Ranges of bytes in memory."""

    def __init__(self, data: np.ndarray) -> None:
        self.data, self.size = data, data.nbytes

    def read_range(self, offset: int, size: int) -> memoryview:
        return self.data[offset:offset + size].data


def _mmap() -> type:
    """Has seek and read, but is bytes as well."""
    import mmap
    return mmap.mmap


__all__ = ["Patience", "Seekable", "Stored", "Web", "opened"]
