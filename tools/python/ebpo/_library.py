"""Loads the shared library, and wraps its functions, errors and arrays."""
from __future__ import annotations

import ctypes
import ctypes.util
import fractions
import os
import pathlib
import re
import subprocess
import sysconfig
import weakref

import numpy as np

from . import _declared as c
from ._checked import checked, index_of, is_own, within
from .errors import BY_ERRNO, BY_STATUS, Error, IOFailure, UnsupportedError

HERE = pathlib.Path(__file__).resolve().parent


def candidates():
    """Generate the candidates for the library; the first one that exists is used."""
    if os.environ.get("EBPO_LIBRARY"):
        yield os.environ["EBPO_LIBRARY"]
        return
    yield from map(str, sorted(HERE.glob("lib/libebpo.so*")))  # the library in a wheel
    several = sysconfig.get_config_var("MULTIARCH") or "."  # Debian has a folder for each machine type
    above = (HERE / "../../..").resolve()
    for folder in (above, above / "lib", above / several):  # prefix, build, Debian
        yield from map(str, sorted(folder.glob("libebpo.so.?")))
    try:
        printed = subprocess.run(["ebpo", "--version", "--verbose"], capture_output=True, text=True)
        found = re.search(r"^library: (/.*) \([0-9.]+\)$", printed.stdout, re.MULTILINE)
        if found:
            yield found[1]
    except OSError:
        pass
    system = ctypes.util.find_library("ebpo")
    if system:
        yield system


def absent(function, library):
    """Return a replacement for a function that the library lacks because it was built without extras."""
    def refuse(*_):
        raise UnsupportedError(f"{library} has no {function}: it was built with -Dextras=disabled; build it with "
                          "-Dextras=enabled", "EBPO_E_UNSUPPORTED", "", "", None)
    return refuse


def load():
    """Load the library and declares the arguments and results of its functions."""
    name = next(candidates(), None)
    if name is None:
        raise ImportError("libebpo is not found; install it, or name it in EBPO_LIBRARY")
    try:
        library = ctypes.CDLL(name)
        ours, its = (c.EBPO_VERSION_MAJOR, c.EBPO_VERSION_MINOR), library.ebpo_version_number()
    except (OSError, AttributeError) as error:
        raise ImportError(f"{name} cannot be loaded as libebpo: {error}") from None
    its = (its // 1000000, its // 1000 % 1000)
    if its[0] != ours[0] or (ours[0] == 0 and its[1] != ours[1]):
        raise ImportError(f"{name} is of version {its[0]}.{its[1]}, this package of {ours[0]}.{ours[1]}; "
                          "install both together, or name another library in EBPO_LIBRARY")
    for function, (result, arguments, names, _) in c.FUNCTIONS.items():
        entry = getattr(library, function, None)
        if entry is None:
            setattr(library, function, absent(function, name))
        else:
            entry.restype, entry.argtypes = result, arguments
            setattr(library, function, checked(entry, arguments, names))
    library.path = name
    return library


lib = load()
BEGUN: dict = {}  # for each struct its initial bytes, from its INIT macro


def fill(struct, values):
    """Set members of a struct in order, from the values of an INIT macro."""
    for (name, kind), value in zip(struct._fields_, values):
        if isinstance(value, list):
            member = getattr(struct, name)
            if isinstance(member, ctypes.Structure):
                fill(member, value)
            else:
                set_items(member, value)
        elif value is not None:
            setattr(struct, name, value)


def set_items(array, values):
    for i, value in enumerate(values):
        if isinstance(value, list):
            set_items(array[i], value)
        else:
            array[i] = value


def made(kind, /, **members):
    """Return a struct with the values of its INIT macro, then with the given members."""
    if kind not in BEGUN:
        struct = kind()
        fill(struct, c.INIT.get(kind, []))
        BEGUN[kind] = bytes(struct)
    struct = kind.from_buffer_copy(BEGUN[kind])
    for name, value in members.items():
        setattr(struct, name, value)
    return struct


def of_members(kind, members, /, **own):
    """Return a struct with the given members. Raises TypeError for members that are unknown or not set by users."""
    known = {name for name, member in kind._fields_ if not is_own(member)} - {"struct_size", "reserved", *own}
    for name in members:
        if name not in known:
            raise TypeError(f"there is no option {name!r}; the options are {', '.join(sorted(known))}")
    return made(kind, **members, **own)


def text(raw):
    return raw.decode("utf-8", "replace")


def error_of(error):
    """Return the Python exception of an ebpo_error."""
    kind, number = BY_STATUS.get(error.status, Error), error.system_error
    if kind is IOFailure:
        kind = BY_ERRNO.get(number, IOFailure)
    name = text(lib.ebpo_status_name(error.status))
    raised = kind(text(error.message), name, text(error.file), text(error.object),
                  None if error.offset < 0 else error.offset)
    if isinstance(raised, IOFailure) and number:
        raised.errno = number
    return raised


def call(name, *arguments):
    """Call a function that can fail, and raises its error."""
    error = c.ebpo_error()
    if getattr(lib, name)(*arguments, ctypes.byref(error)) != 0:
        raise error_of(error)


class Owned:
    """An array interface for memory of another object. The numpy array keeps `owner` alive."""

    def __init__(self, owner, address, shape, dtype, writable=False):
        self.owner = owner
        self.__array_interface__ = {"version": 3, "shape": shape, "typestr": np.dtype(dtype).str,
                                    "data": (address, not writable)}


def array(owner, address, shape, dtype):
    """Return a read-only array over memory of `owner`; None, or an empty array of an empty shape, for NULL."""
    if not address or 0 in shape:
        return np.zeros(shape, dtype) if 0 in shape else None
    return np.asarray(Owned(owner, address, shape, dtype))


def copied(address, shape, dtype):
    """Return a copy of memory that will be freed."""
    dtype = np.dtype(dtype)
    if not address or 0 in shape:
        return np.zeros(shape, dtype)
    if dtype.names:  # __array_interface__ alone does not describe members
        return np.array(Owned(None, address, (*shape, dtype.itemsize), np.uint8)).view(dtype).reshape(shape)
    return np.array(Owned(None, address, shape, dtype))


class Handle:
    """An object of the library. It is freed with the last Python object that refers to it.

    `keep` are the objects that it needs; they are freed after it.
    """

    def __init__(self, pointer, free, *keep):
        self.pointer, self.keep = pointer, keep
        self._end = weakref.finalize(self, Handle.end, getattr(lib, free), pointer, keep)
        self._end.atexit = False  # the process ends, and threads may still run queries

    @staticmethod
    def end(free, pointer, keep):
        free(pointer)
        del keep

    def end_now(self):
        """Free the object before the last reference is dropped. The object must not be used afterwards."""
        self._end()

    def forget(self):
        """Never free the object. It belongs to the process that this one was forked from."""
        self._end.detach()

    @classmethod
    def made(cls, function, *arguments, free, keep=()):
        """Call a function whose last arguments are the address of the new object and the error; return a Handle."""
        pointer = ctypes.c_void_p()
        call(function, *arguments, ctypes.byref(pointer))
        return cls(pointer, free, *keep)

    @property
    def _as_parameter_(self):
        return self.pointer


class Struct:
    """A struct with arrays that the library frees. They are freed before the objects that they need (`keep`)."""

    def __init__(self, kind, free, *keep, **members):
        self.c = made(kind, **members)
        self._end = weakref.finalize(self, Handle.end, getattr(lib, free), ctypes.byref(self.c), keep)
        self._end.atexit = False

    @property
    def _as_parameter_(self):
        return ctypes.byref(self.c)


class Callback:
    """A Python function that the library calls in the querying thread.

    An exception of the function stops the library call, and is raised after the call. ctypes alone would
    ignore the exception.
    """

    def __init__(self, kind, function):
        self.raised, self.function = None, function
        self.given = kind(self.take)

    def take(self, *arguments):
        try:
            return self.function(*arguments)
        except BaseException as error:
            self.raised = error
            return False

    def __enter__(self):
        return self.given

    def __exit__(self, _kind, _error, _trace):
        if self.raised is not None:
            raise self.raised


class Reporter(Callback):
    """A progress callback of Python, or None, as a struct of the library."""

    def __init__(self, progress):
        if not progress:
            self.raised, self.given = None, c.ebpo_progress()
            return
        from .queries import reporter
        progress = reporter(progress)
        super().__init__(c.ebpo_progress_fn, lambda _user, stage, done, total:
                         progress(text(stage), done, total) is not False)
        self.given = c.ebpo_progress(self.given, None)


def size_in_bytes(size):
    """Return a size in bytes from 512000000, "512M", "4G" or "64KiB"; 0 for None."""
    if size is None:
        return 0
    if isinstance(size, str):
        found = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([kKMGT]?)(i?)B?\s*", size)
        if not found:
            raise ValueError(f"{size!r} is not a size; examples: 500000000, '500M', '2GiB'")
        power = " KMGT".index(found[2].upper() or " ")
        size = int(fractions.Fraction(found[1]) * (1024 if found[3] else 1000) ** power)
    return within(index_of(size, "a size"), 0, 2**64 - 1, "a size")
