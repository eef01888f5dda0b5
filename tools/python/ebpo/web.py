"""Reads URLs with Python's HTTP when the library has no HTTP.

Each range has a time limit. All ranges come from one version of the file.
"""
from __future__ import annotations

import collections
import ctypes
import datetime
import email.utils
import functools
import http.client
import io
import os
import random
import re
import ssl
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
import weakref
from typing import Any

from ._checked import integer_as, real, refused
from ._library import size_in_bytes
from .errors import IOFailure, MissingFileError, UnsupportedError
from .ranges import HEAD

SILENT = 20.0  # seconds without a byte or a connection, after which the request is sent again


class Timed(io.RawIOBase):
    """A raw socket reader with a deadline `end` in time.monotonic. Reading later raises TimeoutError."""

    def __init__(self, raw: Any, sock: Any, end: float) -> None:
        self.raw, self.sock, self.end = raw, sock, end

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int | None:
        left = self.end - time.monotonic()
        if left <= 0:
            raise TimeoutError("the response was not complete in time")
        self.sock.settimeout(min(SILENT, left))
        return self.raw.readinto(buffer)

    def close(self) -> None:
        self.raw.close()
        super().close()


class Response(http.client.HTTPResponse):
    """A response whose bytes must all arrive before `end`: status, headers, body and trailers.

    connection: the connection of the response. After the whole body is read, it is appended to `idle` for
        the next request.
    """

    connection: Any = None
    idle: Any = None

    def __init__(self, sock: Any, *rest: Any, end: float, **named: Any) -> None:
        super().__init__(sock, *rest, **named)
        self.fp: Any = io.BufferedReader(Timed(self.fp.detach(), sock, end))

    def close(self) -> None:
        read = self.fp is None or self.length == 0
        super().close()
        connection, self.connection = self.connection, None
        if connection is not None and read and not self.will_close:
            self.idle.append(connection)
        elif connection is not None:
            connection.close()


class Request(urllib.request.Request):
    """A request that, with all its redirects, ends before `end` in time.monotonic.

    idle: for each kind of connection and host, the open connections that are not in use.
    """

    end = 0.0
    idle: Any = None


def opened(handler: Any, kind: Any, request: Any, **options: Any) -> Any:
    """Send a request, on an idle connection if there is one. Return the response; its body is not read."""
    def connection(*host: Any, **given: Any) -> Any:
        made = kind(*host, **given, **options)
        made.response_class = functools.partial(Response, end=request.end)
        return made

    request.timeout = max(0.001, min(SILENT, request.end - time.monotonic()))
    if request.host != urllib.parse.urlsplit(request.full_url).netloc:  # through a proxy
        return handler.do_open(connection, request)
    idle = request.idle.setdefault((kind, request.host), collections.deque())
    while True:
        try:
            used, again = idle.pop(), True
            used.response_class = functools.partial(Response, end=request.end)
            used.sock.settimeout(request.timeout)
        except IndexError:
            used, again = connection(request.host, timeout=request.timeout), False
        try:
            headers = {name.title(): value for name, value in request.header_items()}
            used.request(request.get_method(), request.selector, headers=headers)
            response = used.getresponse()
        except (OSError, http.client.HTTPException) as error:
            used.close()
            if again and not isinstance(error, TimeoutError):
                continue  # the server has closed the idle connection
            if isinstance(error, OSError) and not isinstance(error, http.client.HTTPException):
                raise urllib.error.URLError(error) from error
            raise
        except BaseException:
            used.close()
            raise
        if response.will_close:
            used.close()
        else:
            response.connection, response.idle = used, idle
        response.url, response.msg = request.full_url, response.reason
        return response


class Http(urllib.request.HTTPHandler):
    def http_open(self, request: Any) -> Any:
        return opened(self, http.client.HTTPConnection, request)


class Https(urllib.request.HTTPSHandler):
    def __init__(self) -> None:
        self.certificates = ssl.create_default_context()
        super().__init__(context=self.certificates)

    def https_open(self, request: Any) -> Any:
        return opened(self, http.client.HTTPSConnection, request, context=self.certificates)


class Redirects(urllib.request.HTTPRedirectHandler):
    """Follows redirects by the rules of the library.

    At most five; only http and https; never from https to http. Headers of the caller, which may be secret,
    are sent only to the original server.
    """

    max_redirections = 5

    def redirect_request(self, request: Any, response: Any, code: int, message: str, headers: Any, url: str) -> Any:
        response.close()  # the body may be endless
        new: Any = super().redirect_request(request, response, code, message, headers, url)
        before, after = urllib.parse.urlsplit(request.full_url), urllib.parse.urlsplit(url)
        if after.scheme not in ("http", "https") or (before.scheme, after.scheme) == ("https", "http"):
            raise IOFailure(f"a redirect from {before.scheme} to {after.scheme} is not followed",
                            "EBPO_E_IO")
        if new is not None:
            new.end, new.idle = request.end, request.idle
            if (before.scheme, before.netloc.lower()) != (after.scheme, after.netloc.lower()):
                new.headers = {"Range": new.headers["Range"]}
        return new


@functools.lru_cache(1)
def opener() -> Any:
    """Return the object that sends requests. Its first use reads the system's certificates."""
    return urllib.request.build_opener(Redirects, Http, Https)


class Patience:
    """Decides when a failed request is sent again, and when to give up.

    The pause doubles after each failure. A random factor shortens it, so that many clients do not return at
    the same time. A longer pause that the server requests (Retry-After) is used instead.
    """

    FIRST, LONGEST, AGAIN = 0.2, 20.0, (408, 429, 500, 502, 503, 504)

    def __init__(self, seconds: float, retries: int | None, what: str) -> None:
        self.began, self.seconds, self.retries, self.what, self.failures = time.monotonic(), seconds, retries, what, 0

    def wait(self, error: Exception) -> None:
        """Wait before the next attempt. Raises IOFailure when another attempt is useless or not allowed."""
        code, reason = getattr(error, "code", None), getattr(error, "reason", error)
        if code is not None and code not in self.AGAIN:
            raise self.failure(f"the server returned status {code}",
                               MissingFileError if code in (404, 410) else IOFailure) from error
        if isinstance(reason, ssl.SSLCertVerificationError):
            raise self.failure(f"the server's certificate is not trusted: {reason.verify_message}") from error
        pause = min(self.LONGEST, self.FIRST * 2**min(self.failures, 16)) * random.uniform(0.5, 1)
        pause = max(pause, self.retry_after(error))
        self.failures += 1
        gone = time.monotonic() - self.began
        if gone + pause > self.seconds or (self.retries is not None and self.failures > self.retries):
            said = f"status {code}" if code is not None else str(reason)[:200]
            raise self.failure(f"no response after {self.failures} requests in {gone:.1f} s; the last failure: "
                               f"{said}; {self.seconds:g} s (time_limit) and "
                               f"{'any number of' if self.retries is None else self.retries} retries are allowed"
                               ) from error
        threading.Event().wait(pause)

    def failure(self, message: str, kind: type[IOFailure] = IOFailure) -> IOFailure:
        return kind(f"{self.what}: {message}", "EBPO_E_IO", self.what)

    @staticmethod
    def retry_after(error: Exception) -> float:
        """Return the delay in seconds that a server requests as a number or a date. Returns 0 without a request."""
        text = (getattr(error, "headers", None) or {}).get("Retry-After") or ""
        if text.strip().isdecimal():
            return float(text)
        try:
            then = email.utils.parsedate_to_datetime(text)
            return max(0.0, (then - datetime.datetime.now(datetime.timezone.utc)).total_seconds())
        except (TypeError, ValueError, OverflowError):
            return 0.0


def close_all(idle: dict) -> None:
    for connections in idle.values():
        while connections:
            connections.pop().close()


class Web:
    """A URL that is read with Python's HTTP, from one version of the file. Any number of threads.

    time_limit: seconds for a range, with all its requests.
    retries: number of requests that may fail; None: any number.
    whole_limit, unversioned: as in ebpo_http_options.

    size: the size of the file.
    head: the first bytes of the file; the whole file when the server supports no ranges or versions.
    """

    def __init__(self, url: str, headers: dict | None = None, time_limit: float = 120.0, retries: int | None = 5,
                 whole_limit: int | str = 64 << 20, unversioned: bool = False) -> None:
        self.url, self.headers, self.shown = url, dict(headers or {}), url.partition("?")[0]
        if re.search(r"[^\x21-\x7e]", url):
            raise refused(self.shown, "a URL may contain only printable ASCII characters; write others as %XX")
        for name, text in self.headers.items():
            if not re.fullmatch(r"[!-9;-~]+", name) or re.search(r"[^\t\x20-\x7e\x80-\xff]", text):
                raise refused(self.shown, "a header must be 'Name: value' on one line")
        self.time_limit, self.retries = real(time_limit, "time_limit"), retries
        if not 0 < self.time_limit <= 1e6:
            raise refused(self.shown, "a time-out must be above 0 and at most 1000000 seconds")
        if retries is not None:
            self.retries = integer_as(ctypes.c_uint)(retries, "retries")
        self.whole_limit, self.unversioned = size_in_bytes(whole_limit), unversioned
        self.version: Any = None
        self.size = self.requests = self.received = 0
        self.head = b""
        self.lock = threading.Lock()  # protects the counts
        self.idle: dict = {}
        self.process = os.getpid()
        weakref.finalize(self, close_all, self.idle)
        self.head = self.first()

    def first(self) -> bytes:
        """Read the first bytes, the size and the version.

        Read the whole file when the server supports no ranges or versions.
        """
        data = self.get(0, HEAD)
        if len(data) < self.size and self.version[0] is None and not self.unversioned:
            if self.size > self.whole_limit:
                raise UnsupportedError(f"{self.shown}: the server sends neither ETag nor Last-Modified, and "
                                       f"{self.size} bytes exceed whole_limit; download the file, or "
                                       "allow unversioned files (unversioned=True)", "EBPO_E_UNSUPPORTED", self.shown)
            data = self.get(0, self.size, at_once=True)
        return data

    def read_range(self, offset: int, size: int) -> bytes:
        """Return a range of bytes. Raises IOFailure when they do not arrive in time."""
        if offset + size <= len(self.head):
            return self.head[offset:offset + size]
        return self.get(offset, size)

    def get(self, offset: int, size: int, at_once: bool = False) -> bytes:
        """Request a range, or the whole file from a server that supports no ranges.

        at_once: the server must send the range in one response; otherwise it may send it in parts.
        """
        patience, data = Patience(self.time_limit, self.retries, self.shown), bytearray()
        while True:
            try:
                self.send(offset + len(data), offset + size, patience, data)
                if self.size:
                    size = min(size, max(self.size - offset, len(data)))
                if len(data) >= size:
                    return bytes(data)
                if at_once:
                    raise patience.failure("the server sends parts of the file without a version; download the file")
            except (urllib.error.URLError, TimeoutError, ConnectionError, ssl.SSLError, http.client.HTTPException) as error:
                if isinstance(error, urllib.error.HTTPError):
                    error.close()
                patience.wait(error)
            except (ValueError, OSError) as error:
                if isinstance(error, IOFailure):
                    raise
                raise patience.failure(f"invalid response: {error}") from error
            if at_once:
                data.clear()

    def send(self, begin: int, end: int, patience: Patience, data: bytearray) -> None:
        """Send one request. Append the received bytes to `data`, even when the request then fails."""
        request = Request(self.url, headers={**self.headers, "Range": f"bytes={begin}-{end - 1}"})
        if self.process != os.getpid():  # after a fork the connections belong to the other process
            self.process, self.idle = os.getpid(), {}
        request.end, request.idle = patience.began + self.time_limit, self.idle
        with self.lock:
            self.requests += 1
        before = len(data)
        try:
            with opener().open(request) as response:
                if (response.headers["Content-Encoding"] or "identity").lower() != "identity":
                    raise patience.failure("the server sends the file compressed (Content-Encoding); download it")
                if response.status == 200 and self.version is None and begin == 0:
                    self.take_whole(response, patience, data)
                else:
                    self.take(response, self.range_of(response, begin, end, patience), patience, data)
        finally:
            with self.lock:
                self.received += len(data) - before

    def range_of(self, response: Any, begin: int, end: int, patience: Patience) -> int:
        """Return how many bytes of the range the server sends. Raises IOFailure for another range or version."""
        if response.status != 206:
            raise patience.failure(f"the server does not support ranges (status {response.status})")
        stated = re.fullmatch(r"bytes (\d{1,18})-(\d{1,18})/(\d{1,18})", (response.headers["Content-Range"] or "").strip())
        if not stated:
            raise patience.failure("the server does not state which range it sent")
        first, last, size = map(int, stated.groups())
        etag = response.headers["ETag"] and re.sub(r"^\s*W/", "", response.headers["ETag"])
        version = etag or response.headers["Last-Modified"], size
        if self.version not in (None, version):
            raise patience.failure("the file on the server has changed since it was opened; open it again")
        length = response.headers["Content-Length"]
        if first != begin or not begin <= last < min(end, size) or (length and length.strip() != str(last + 1 - begin)):
            raise patience.failure("the server sent another range than requested")
        self.version, self.size = version, size
        return last + 1 - begin

    @staticmethod
    def take(response: Any, size: int, patience: Patience, data: bytearray) -> None:
        """Append a body of `size` bytes. Raises ConnectionError for a shorter body, IOFailure for a longer one."""
        whole = len(data) + size
        while len(data) < whole + 1:
            some = response.read1(min(1 << 16, whole + 1 - len(data)))
            if not some:
                break
            data += some
        if len(data) > whole:
            raise patience.failure("the server sent more bytes than its Content-Range states")
        if len(data) < whole:
            raise ConnectionError(f"the connection ended after {len(data) - whole + size} bytes")

    def take_whole(self, response: Any, patience: Patience, data: bytearray) -> None:
        """Append the body of a response with status 200. Its length must be known, or it must be chunked."""
        try:
            self.take_all(response, patience, data)
        except BaseException:
            data.clear()  # the next response may be of another version
            raise

    def take_all(self, response: Any, patience: Patience, data: bytearray) -> None:
        size, content = response.length, response.headers["Content-Type"] or ""
        if content.startswith("text/"):
            raise patience.failure(f"the server sends {content[:60]} instead of the file; check the URL, and whether it "
                                   "requires a login")
        if size is None and not response.chunked:
            raise patience.failure("the server neither supports ranges nor states the length of the file")
        if (size or 0) <= self.whole_limit:
            while len(data) <= self.whole_limit:
                some = response.read1(1 << 16)
                if not some:
                    break
                data += some
        if max(size or 0, len(data)) > self.whole_limit:
            raise UnsupportedError(f"{self.shown}: the server does not support ranges, and the file has more than "
                                   f"{self.whole_limit} bytes; download it", "EBPO_E_UNSUPPORTED", self.shown)
        if size is not None and len(data) != size:
            raise ConnectionError(f"the connection ended after {len(data)} of {size} bytes")
        self.version, self.size = (None, len(data)), len(data)
