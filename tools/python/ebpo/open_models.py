"""Keeps models of a process open between queries, within one memory budget."""
from __future__ import annotations

import ctypes
import itertools
import os
from typing import Any

from . import _declared as c
from ._checked import members_of
from ._library import Handle, lib, made, size_in_bytes, text
from .errors import BY_STATUS, Error
from .forks import renew_after_fork
from .signatures import Size
from .sources import opened, shown

BUDGET = 1 << 30
CODES: dict[type, int] = {kind: code for code, kind in BY_STATUS.items()}
IO, CANCELLED = -3, -9
ENTRY: dict = dict(members_of(c.ebpo_catalogue_options))

_files: dict[int, Handle] = {}  # files that the library has open, by their addresses
_options: dict[int, dict] = {}  # options of catalogues by the number of their opener
_numbers: dict[str, int] = {}
_new_numbers = itertools.count(1)
_raised: dict[str, BaseException] = {}  # exceptions that are not library errors, by their messages


def opener(options: dict) -> int:
    """Return the number by which `_open_file` finds these options for URLs. Any thread may call this."""
    key = repr(sorted(options.items()))
    if key not in _numbers:
        number = next(_new_numbers)
        _options[number] = options
        _numbers.setdefault(key, number)  # another thread may have set it
    return _numbers[key]


def opened_by(name: str, options: dict) -> Handle:
    """Return an open ebpo_file. options: options for URLs; by default a server may be unavailable for some minutes."""
    http: dict = {}
    if "://" in name:
        http = dict(options)
        if name.startswith(("http://", "https://")) and "storage_options" not in options:
            http = {"time_limit": 300.0, "retries": 60, **options}
    storage, expansion = http.pop("storage_options", None), http.pop("max_expansion", None)
    return opened(name, http, storage, expansion or 0)


def _open_file(number: int, path: bytes, out: int, error: int) -> int:
    """Open a file for the library. The library calls it in any thread."""
    try:
        file = opened_by(os.fsdecode(path), _options[number])
        _files[file.pointer.value] = file
        ctypes.c_void_p.from_address(out).value = file.pointer.value
        return 0
    except BaseException as raised:
        struct = c.ebpo_error.from_address(error) if error else made(c.ebpo_error)
        code = CODES.get(type(raised), CANCELLED if isinstance(raised, KeyboardInterrupt) else IO)
        if isinstance(raised, OSError):
            struct.system_error = raised.errno or 0
        said = str(raised) if type(raised) in CODES else f"{type(raised).__name__}: {raised}"
        struct.status, struct.message = code, shown(said)[:479]
        if isinstance(raised, Error):
            struct.file, struct.object = shown(raised.file)[:255], shown(raised.object)[:63]
        if type(raised) not in CODES:
            _raised[text(struct.message)] = raised
        return code


def _close_file(_number: int, file: int) -> None:
    _files.pop(file, None)


OPEN_FILE, CLOSE_FILE = ENTRY["open_file"](_open_file), ENTRY["close_file"](_close_file)


def raised_by(error: Error) -> BaseException:
    """Return the exception that caused an error in `_open_file`, or the error itself."""
    return _raised.pop(str(error), error)


class OpenModels:
    """Open models of catalogues. The least recently used model is closed first. Any number of threads.

    memory: budget in bytes for all models together.
    """

    def __init__(self, memory: Size | None = None) -> None:
        self._memory = size_in_bytes(memory) or BUDGET
        self._make()
        renew_after_fork(self)

    def _make(self) -> None:
        options = made(c.ebpo_catalogue_models_options, memory=self._memory)
        self.models = Handle.made("ebpo_catalogue_models_new", ctypes.byref(options), free="ebpo_catalogue_models_free")

    def _renew(self) -> None:
        self.models.forget()
        for file in _files.values():
            file.forget()
        _files.clear()
        self._make()

    @property
    def memory(self) -> int:
        return self._memory

    @memory.setter
    def memory(self, size: Size) -> None:
        self._memory = size_in_bytes(size) or BUDGET
        lib.ebpo_catalogue_models_set_memory(self.models, self._memory)

    def stats(self) -> dict[str, int]:
        """Return statistics of all models.

        Since the process started: opened, closed (models), bytes_read, reads, loads, hits, evicted (as in
        `Model.stats`). Current values: open (models), memory (bytes).
        """
        counts, totals = made(c.ebpo_catalogue_models_stats), made(c.ebpo_model_stats)
        lib.ebpo_catalogue_models_get_stats(self.models, ctypes.byref(counts), ctypes.byref(totals))
        stats = {name: getattr(totals, name) for name in ("bytes_read", "reads", "loads", "hits", "evicted", "memory")}
        return dict(stats, opened=counts.opened, closed=counts.closed, open=counts.open)

    def clear(self) -> None:
        """Close the models that are not in use."""
        lib.ebpo_catalogue_models_close_idle(self.models)


_process_models = OpenModels()
_process_models.models.forget()  # never freed: threads may still run queries when the process ends


def process_models(memory: Size | None = None) -> OpenModels:
    """Return the open models of this process. memory: their budget from now on; None: unchanged."""
    if memory is not None:
        _process_models.memory = memory
    return _process_models
