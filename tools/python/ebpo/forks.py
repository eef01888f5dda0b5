"""Renews objects in a process that os.fork made.

Only the thread that called fork() exists in the new process. Locks of other threads stay locked, and threads of the
library are missing. So the new process does not use the library's objects of the old process: it makes new ones.
"""
from __future__ import annotations

import os
import weakref
from typing import Protocol


class Renewable(Protocol):
    def _renew(self) -> None:
        """Forget locks and objects of the library without freeing them. Called in the new process."""


_objects: weakref.WeakSet[Renewable] = weakref.WeakSet()


def renew_after_fork(thing: Renewable) -> None:
    """Call thing._renew() in each process that is forked from now on."""
    _objects.add(thing)


def _renew_all() -> None:
    for thing in list(_objects):
        thing._renew()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_renew_all)
