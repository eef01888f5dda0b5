"""Decides without a budget how much of a model is in memory: subtrees, until the whole model is cheaper."""
from __future__ import annotations

import contextlib
import ctypes
import threading
from typing import Any

from . import _declared as c
from ._library import Handle, call, lib, made
from .errors import LimitError

SMALL = 16 << 20  # a whole model of at most this size is loaded at once, in some milliseconds
# BELIEVED: loads before their mean time is used. CERTAIN: factor by which estimated loads must
# exceed the number of subtrees.
BELIEVED, CERTAIN = 8, 4
FIRST = 16  # queries before the first decision


class Automatic:
    """Makes the decisions of the command without --memory (tools/cli/commands/query_holding.c).

    At most half of the free memory is used.

    options: the model's options, which are changed here.
    waiting: subtrees are loaded, and the whole model would fit into memory.
    """

    def __init__(self, file: Handle, options: Any) -> None:
        self.file, self.options, self.waiting = file, options, False
        self.lock = threading.Lock()  # protects the counts
        self.queries, self.seconds, self.subtrees, self.next = 0, 0.0, 0, FIRST
        wished = options.memory or options.cut_level >= 0 or options.prefetch
        info = c.ebpo_info.from_address(lib.ebpo_file_info(file))
        if not wished and info.parts & c.EBPO_PART_MESH:
            self._decide(info)

    def _plan(self) -> Any:
        plan = made(c.ebpo_model_plan)
        call("ebpo_model_memory", self.file, ctypes.byref(self.options), ctypes.byref(plan))
        return plan

    def _decide(self, info: Any) -> None:
        plan = self._plan()
        if plan.budget:  # the library has chosen a budget for a file elsewhere
            return
        options = self.options
        options.memory = limit = max(lib.ebpo_free_memory() // 2, plan.least)
        plan = self._plan()
        if plan.resident and plan.whole <= SMALL:
            return
        options.cut_level = info.subtree_level or -1
        if options.cut_level < 0:  # plan as if the whole model did not fit
            options.memory = plan.whole - 1 if plan.resident else limit
            with contextlib.suppress(LimitError):  # the whole model may need no more than the least budget
                options.cut_level = self._plan().cut_level
            options.memory = limit
        self.subtrees = self._plan().subtrees
        self.waiting = bool(plan.resident and self.subtrees)

    def piece(self) -> int:
        """Return the greatest number of queries before the next decision."""
        return max(FIRST, self.queries) if self.waiting else 1 << 62

    def add(self, queries: int, seconds: float) -> None:
        with self.lock:
            self.queries += queries
            self.seconds += seconds

    def pays(self, model: Handle, total: int, parts_share: float) -> bool:
        """Return True when loading the whole model is cheaper.

        This is so when loading subtrees has cost as much as loading the whole model, or certainly will.

        total: number of queries that are known to follow.
        parts_share: share of the queries' time that loading subtrees costs.
        """
        if self.queries < self.next:
            return False
        self.next = self.queries + self.queries // 8
        stats = made(c.ebpo_model_stats)
        lib.ebpo_model_get_stats(model, ctypes.byref(stats))
        if stats.loads < BELIEVED:
            return False
        with self.lock:
            each = stats.load_seconds / stats.loads
            spent = min(stats.evicted, stats.loads) * each + parts_share * max(0.0, self.seconds - stats.load_seconds)
            expected = stats.loads / self.queries * (total - self.queries)
        return spent >= each * self.subtrees or (stats.loads < self.subtrees / CERTAIN and
                                                 expected >= CERTAIN * self.subtrees)

    def whole(self) -> Any:
        """Return the options of a model that is completely in memory."""
        options = c.ebpo_model_options.from_buffer_copy(self.options)
        options.cut_level = -1
        return options
