"""Ranges of a remote source: joined, requested in parallel and ahead of the reader, within bounded memory."""
from __future__ import annotations

import bisect
import collections
import os
import threading
from typing import Any, Iterator

HEAD = 1 << 17  # first bytes of a source, which are read when it is opened
MEMORY = 48 << 20  # bytes for pieces that are prefetched or were read last
CONNECTIONS = 16  # requests at a time
GAP, GAP_OF_MANY, MANY = 1 << 14, 1 << 15, 256  # bytes between ranges that cost less than another request
MAX = 4 << 20  # bytes of one request
STALE = 64  # prefetch calls after which a piece that was not read is not expected to be read
NOTED, COMING, THERE, FAILED = range(4)


class Piece:
    """A range of bytes that one request fetches.

    wanted: bytes with a prefetch hint that are not read yet. users: number of readers.
    """

    __slots__ = ("begin", "end", "state", "wanted", "plan", "used", "users", "data", "error")

    def __init__(self, begin: int, end: int, plan: int) -> None:
        self.begin, self.end, self.state, self.plan = begin, end, NOTED, plan
        self.wanted = self.used = self.users = 0
        self.data: Any = None
        self.error: BaseException | None = None

    @property
    def size(self) -> int:
        return self.end - self.begin


class Ranges:
    """A reader of an object with `size` and `read_range(offset, size)`, which several threads call at once.

    It works like the library's reader of URLs (lib/io/http_cache.c). Ranges of prefetch hints are joined
    over small gaps, cut into requests of at most MAX bytes, and fetched ahead of the reader as long as they
    fit into `memory`.

    connections: number of requests at a time.
    """

    def __init__(self, source: Any, size: int, *, memory: int = MEMORY, connections: int = CONNECTIONS) -> None:
        self.source, self.size, self.memory, self.connections = source, size, memory, connections
        head = getattr(source, "head", None)
        self.head = read_whole(source, 0, min(HEAD, size)) if head is None else head
        self.changed = threading.Condition()  # its lock protects the following members
        self.begins: list[int] = []  # offsets of pieces, ascending; pieces do not overlap
        self.pieces: dict[int, Piece] = {}
        self.queue: collections.deque[Piece] = collections.deque()
        self.unrequested: set[int] = set()  # offsets of pieces with a prefetch hint and without a request
        self.held = self.plan = self.clock = self.running = 0
        self.process = os.getpid()

    # ---- pieces; the caller holds the lock ----

    def _over(self, begin: int, end: int) -> Iterator[Piece]:
        """Yield the pieces that overlap a range, in order."""
        at = max(0, bisect.bisect_right(self.begins, begin) - 1)
        for start in self.begins[at:bisect.bisect_left(self.begins, end)]:
            if self.pieces[start].end > begin:
                yield self.pieces[start]

    def _cover(self, begin: int, end: int) -> None:
        """Add pieces for the bytes of a range that are in no piece."""
        begin = max(begin, len(self.head))
        for piece in [*self._over(begin, end), None]:
            stop = piece.begin if piece else end
            if begin < stop:
                count = -(-(stop - begin) // MAX)
                cuts = [begin + (stop - begin) * i // count for i in range(count + 1)]
                for low, high in zip(cuts, cuts[1:]):
                    self.pieces[low] = Piece(low, high, self.plan)
                    bisect.insort(self.begins, low)
            begin = piece.end if piece else end

    def _remove(self, piece: Piece) -> None:
        self._drop(piece)
        del self.pieces[piece.begin]
        self.unrequested.discard(piece.begin)
        self.begins.pop(bisect.bisect_left(self.begins, piece.begin))

    def _drop(self, piece: Piece) -> None:
        """Forget the bytes of a piece, or its error."""
        if piece.state in (COMING, THERE):
            self.held -= piece.size
        piece.state, piece.data, piece.error = NOTED, None, None

    def _reserve_space(self, size: int) -> None:
        """Forget pieces until `size` more bytes fit: those read longest ago, then those with old hints."""
        if self.held + size <= self.memory:
            return
        idle = [piece for piece in self.pieces.values() if piece.state == THERE and not piece.users and
                (not piece.wanted or piece.plan + STALE < self.plan)]
        for piece in sorted(idle, key=lambda piece: (piece.wanted > 0, piece.used)):
            if self.held + size <= self.memory:
                break
            self._remove(piece)

    def _check_process(self) -> None:
        """After a fork, forget the requests of the other process's threads."""
        if self.process != os.getpid():
            self.process, self.running = os.getpid(), 0
            self.queue.clear()
            for piece in self.pieces.values():
                if piece.state == COMING:
                    self._drop(piece)

    def _start(self, piece: Piece, urgent: bool) -> None:
        piece.state = COMING
        self.unrequested.discard(piece.begin)
        self.held += piece.size
        (self.queue.appendleft if urgent else self.queue.append)(piece)
        if self.running < self.connections:
            self.running += 1
            try:
                threading.Thread(target=self._work, daemon=True).start()
            except RuntimeError:  # no further thread could be started: readers fetch their own pieces
                self.running -= 1

    def _ahead(self, begin: int) -> None:
        """Request pieces with a prefetch hint, from an offset on, as long as they fit."""
        for start in sorted(start for start in self.unrequested if start >= begin):
            piece = self.pieces[start]
            self._reserve_space(piece.size)
            if self.held + piece.size > self.memory:
                return
            self._start(piece, False)

    # ---- other threads ----

    def _work(self) -> None:
        """Fetch pieces until the queue is empty."""
        while True:
            with self.changed:
                if not self.queue:
                    self.running -= 1
                    return
                piece = self.queue.popleft()
            data, error = None, None
            try:
                data = read_whole(self.source, piece.begin, piece.size)
            except BaseException as raised:
                error = raised
            with self.changed:
                if error is None:
                    piece.state, piece.data = THERE, data
                else:
                    self._drop(piece)
                    if piece.users:  # the readers raise the error; without readers the piece is requested again later
                        piece.state, piece.error = FAILED, error
                self.changed.notify_all()

    # ---- methods that the library calls ----

    def prefetch(self, ranges: list) -> None:
        """Accept prefetch hints (offset, size). Each range will be read about once. Does not wait."""
        ranges = sorted((offset, offset + size) for offset, size in ranges if size)
        if not ranges:
            return
        gap, joined = GAP_OF_MANY if len(ranges) > MANY else GAP, [list(ranges[0])]
        for begin, end in ranges[1:]:
            if begin - joined[-1][1] <= gap:
                joined[-1][1] = max(joined[-1][1], end)
            else:
                joined.append([begin, end])
        with self.changed:
            self._check_process()
            self.plan += 1
            for begin, end in joined:
                self._cover(begin, end)
            anew = {piece.begin for piece in self._over(ranges[0][0], joined[-1][1]) if not piece.wanted}
            for begin, end in ranges:
                for piece in self._over(begin, end):
                    piece.plan = self.plan
                    if piece.begin in anew:  # earlier hints have counted the other pieces
                        piece.wanted += min(end, piece.end) - max(begin, piece.begin)
                        if piece.state == NOTED:
                            self.unrequested.add(piece.begin)
            self._ahead(0)

    def read_range(self, offset: int, size: int) -> bytes:
        """Return a range of bytes. Its pieces are requested at the same time."""
        end = offset + size
        parts = [self.head[offset:end]] if offset < len(self.head) else []
        if end <= len(self.head):
            return parts[0]
        with self.changed:
            self._check_process()
            self._cover(offset, end)
            pieces = list(self._over(max(offset, len(self.head)), end))
            for piece in pieces:
                piece.users += 1
            try:
                for piece in pieces:
                    self._await(piece, pieces)
                    self._ahead(piece.end)
                    low, high = max(offset, piece.begin), min(end, piece.end)
                    parts.append(memoryview(piece.data)[low - piece.begin:high - piece.begin])
                    piece.wanted = max(0, piece.wanted - (high - low))
            finally:
                self._release(pieces)
        return b"".join(parts)

    def _await(self, piece: Piece, pieces: list) -> None:
        """Request a piece and the following pieces, and wait for it. Raises the error of the request."""
        while piece.state != THERE:
            if piece.state == FAILED:
                raise piece.error  # type: ignore[misc]
            for other in pieces[pieces.index(piece):]:
                if other.state == NOTED:
                    self._reserve_space(other.size)
                    if other is piece or self.held + other.size <= self.memory:
                        self._start(other, True)
            if piece in self.queue:  # before pieces that have only a prefetch hint
                self.queue.remove(piece)
                self.queue.appendleft(piece)
            if self.running:
                self.changed.wait()
                continue
            self.running += 1
            self.changed.release()
            try:
                self._work()
            finally:
                self.changed.acquire()

    def _release(self, pieces: list) -> None:
        self.clock += 1
        for piece in pieces:
            piece.users -= 1
            piece.used = self.clock
            if not piece.users and piece.state == FAILED:
                self._drop(piece)
            if not piece.users and piece.state == NOTED and not piece.wanted:
                self._remove(piece)
        self._reserve_space(0)

    def close(self) -> None:
        """Stop fetching. Requests that were sent end by themselves."""
        with self.changed:
            self.queue.clear()


def read_whole(source: Any, offset: int, size: int) -> Any:
    """Read a range of a source. Raises OSError when it returns another number of bytes."""
    data = memoryview(source.read_range(offset, size)).cast("B")
    if len(data) != size:
        raise OSError(f"expected {size} bytes at byte {offset}, got {len(data)}")
    return data
