"""The models that a process holds between questions, all within one budget."""
from __future__ import annotations

import contextlib
import threading
from collections import OrderedDict
from typing import Any, Iterator

from ._library import size_in_bytes
from .errors import FormatError
from .model import Model
from .model import open as open_model

BUDGET = 1 << 30
SHARES = 8  # models that are asked at a time at most, where there are many
COUNTED = ("bytes_read", "reads", "loads", "hits", "evicted")


class Held:
    """A model, how many use it, and what it may take while they do."""

    def __init__(self, share: int) -> None:
        self.share, self.users, self.lock = share, 1, threading.Lock()
        self.model: Model | None = None

    @property
    def bytes(self) -> int:
        if self.users or self.model is None:
            return self.share
        return int(self.model.stats["memory"])


class Holding:
    """Models that stay open, the least recently asked goes first. Any number of threads.

    memory: bytes for all of them together.
    """

    def __init__(self, memory: int | str | None = None) -> None:
        self.memory = size_in_bytes(memory) or BUDGET
        self._held: OrderedDict[Any, Held] = OrderedDict()
        self._changed = threading.Condition()
        self._gone = dict.fromkeys(("opened", "closed", *COUNTED), 0)

    @contextlib.contextmanager
    def model(self, source: str, digest: str = "", among: int = 1, **options: Any) -> Iterator[Model]:
        """The model of a path or URL, opened if it is not held.

        digest: its content_sha256; another one is a FormatError: the file has changed. "": any.
        among: it is one of so many models, which share the budget.
        """
        share = self.memory // max(1, min(among, SHARES))
        key = source, digest, share, repr(sorted(options.items()))
        held = self._take(key, share)
        try:
            with held.lock:  # of several that want it one opens it
                if held.model is None:
                    held.model = self._opened(source, digest, share, options)
            yield held.model
        finally:
            self._give_back(key, held)

    def _opened(self, source: str, digest: str, share: int, options: dict) -> Model:
        model = open_model(source, memory=share, **options)
        found = model.info.content_sha256
        if digest and found != digest:
            model.close()
            raise FormatError(f"{source}: the file has changed: its content is {found[:16]}..., and the question is about "
                              f"{digest[:16]}...; ask anew", "EBPO_E_FORMAT", source)
        with self._changed:
            self._gone["opened"] += 1
        return model

    def _take(self, key: Any, share: int) -> Held:
        with self._changed:
            while True:
                if key in self._held:
                    held = self._held[key]
                    self._held.move_to_end(key)
                    more = held.share - held.bytes  # it may grow again
                    if not self._make_room(more, held):
                        self._changed.wait()
                        continue
                    held.users += 1
                    return held
                if self._make_room(share, None):
                    held = self._held[key] = Held(share)
                    return held
                self._changed.wait()

    def _make_room(self, size: int, but: Held | None) -> bool:
        """Closes what is idle until there is room; whether there is, or nothing else is held."""
        taken = sum(held.bytes for held in self._held.values())
        for key in [key for key, held in self._held.items() if not held.users and held is not but]:
            if taken + size <= self.memory:
                break
            taken -= self._held[key].bytes
            self._close(key)
        busy = any(held.users for held in self._held.values() if held is not but)
        return taken + size <= self.memory or not busy

    def _close(self, key: Any) -> None:
        model = self._held.pop(key).model
        if model is not None:
            self._count(model, self._gone)
            self._gone["closed"] += 1
            model.close()

    @staticmethod
    def _count(model: Model, counts: dict) -> None:
        stats = model.stats
        for name in COUNTED:
            counts[name] += stats[name]

    def _give_back(self, key: Any, held: Held) -> None:
        with self._changed:
            held.users -= 1
            if not held.users and (held.model is None or held.model._made is None):  # of no use, or refused
                self._held.pop(key, None)
                if held.model is not None:
                    held.model.close()
            self._changed.notify_all()

    def counts(self) -> dict[str, int]:
        """Since the process began: opened, closed: models; bytes_read, reads, loads, hits, evicted: as in
        `Model.stats`, of all of them; now: models, memory (bytes)."""
        with self._changed:
            counts = dict(self._gone, models=len(self._held), memory=0)
            for held in self._held.values():
                if held.model is not None and held.model._made is not None:
                    self._count(held.model, counts)
                    counts["memory"] += int(held.model.stats["memory"])
        return counts

    def clear(self) -> None:
        """Closes what nobody uses."""
        with self._changed:
            for key in [key for key, held in self._held.items() if not held.users]:
                self._close(key)


_ours = Holding()


def ours(memory: int | str | None = None) -> Holding:
    """That of this process. A budget that is given holds from now on."""
    if memory is not None:
        _ours.memory = size_in_bytes(memory) or BUDGET
    return _ours
