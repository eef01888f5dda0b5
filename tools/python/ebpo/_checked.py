"""Converts values of Python to values of C, for the whole package.

Every argument of a library function, every struct member and every array passes through this module. No value is
truncated, wrapped or rounded silently:

integers    Integers of Python and numpy; bools become 0 and 1. A value out of the range of the C type raises
            ArgumentError. A float raises TypeError, even when it is an integral number.
bools       True, False, 0 and 1. Another integer raises ArgumentError.
reals       Every value that float() accepts, except texts. An integer that no double equals raises ArgumentError.
texts       str as UTF-8, paths by os.fsencode, bytes. A NUL, or a character without an encoding in UTF-8,
            raises ArgumentError.
arrays      Arrays of numbers. The rules for integers apply to each item. Masked reals become NaN; masked integers
            raise ArgumentError.

ArgumentError is a ValueError.
"""
from __future__ import annotations

import ctypes
import operator
import os
from typing import Any, Callable

import numpy as np

from .errors import ArgumentError

INTEGERS = {getattr(ctypes, name) for name in
            ("c_int8", "c_uint8", "c_int16", "c_uint16", "c_int32", "c_uint32", "c_int64", "c_uint64")}
FUNCTION = ctypes.CFUNCTYPE(None).__mro__[1]  # the base of all types of functions
REALS = {ctypes.c_float, ctypes.c_double}


def refused(what: str, why: str) -> ArgumentError:
    """Return the exception for an invalid argument or option named `what`."""
    return ArgumentError(f"{what}: {why}", "EBPO_E_ARGUMENT")


def index_of(value: Any, what: str) -> int:
    """Return the value as an int. Raises TypeError when it is not an integer."""
    try:
        return operator.index(bool(value) if isinstance(value, np.bool_) else value)
    except TypeError:
        raise TypeError(f"{what}: expected an integer, got {type(value).__name__}") from None


def within(number: int, low: int, high: int, what: str) -> int:
    """Return the number if it is from low to high. Raises ArgumentError otherwise."""
    if not low <= number <= high:
        shown = str(number) if number.bit_length() <= 128 else f"an integer of {number.bit_length()} bits"
        raise refused(what, f"{shown} is out of range; give {low} to {high}")
    return number


def integer_as(kind: Any) -> Callable:
    """Return a function that checks integers of a C type."""
    bits, signed = 8 * ctypes.sizeof(kind), kind(-1).value < 0
    low, high = (-2**(bits - 1), 2**(bits - 1) - 1) if signed else (0, 2**bits - 1)

    def convert(value: Any, what: str) -> int:
        if type(value) is int and low <= value <= high:
            return value
        return within(index_of(value, what), low, high, what)

    return convert


def truth(value: Any, what: str) -> bool:
    """Convert a bool, or 0 or 1."""
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if not isinstance(value, (int, np.integer)):
        raise TypeError(f"{what}: expected True or False, got {type(value).__name__}")
    return bool(within(int(value), 0, 1, what))


def real(value: Any, what: str) -> float:
    """Convert a number to the nearest double. Raises ArgumentError for an integer that no double equals."""
    if type(value) is float:
        return value
    if isinstance(value, (str, bytes, np.complexfloating)):
        raise TypeError(f"{what}: expected a real number, got {type(value).__name__}")
    try:
        number = float(value)
    except OverflowError:
        raise refused(what, "the number is larger than every double") from None
    except (TypeError, ValueError):
        raise TypeError(f"{what}: expected a real number, got {type(value).__name__}") from None
    if isinstance(value, (int, np.integer)) and int(number) != int(value):
        raise refused(what, f"no double equals the integer {value}; give a float")
    return number


def text(value: Any, what: str) -> bytes | None:
    """Convert a text to UTF-8, and a path to the bytes of the system."""
    if value is None:
        return None
    if isinstance(value, str):
        try:
            value = value.encode()
        except UnicodeEncodeError as error:
            raise refused(what, f"UTF-8 has no {value[error.start]!a} (character {error.start})") from None
    elif isinstance(value, os.PathLike):
        value = path(value, what)
    if not isinstance(value, bytes):
        raise TypeError(f"{what}: expected a text, got {type(value).__name__}")
    if b"\0" in value:
        raise refused(what, f"a NUL (byte {value.index(0)}) would end the text")
    return value


def path(value: Any, what: str = "path") -> bytes:
    """Convert a file name to the bytes of the system. Raises TypeError unless it is str, bytes or os.PathLike."""
    try:
        return text(os.fsencode(value), what) or b""
    except UnicodeEncodeError as error:
        raise refused(what, f"no file name has {error.object[error.start]!a} (character {error.start})") from None


def texts_of(size: int) -> Callable:
    """Return a function that checks texts for a member char[size], which ends with a NUL."""
    def convert(value: Any, what: str) -> bytes:
        found = text(value, what) or b""
        if len(found) >= size:
            raise refused(what, f"the text has {len(found)} bytes; give at most {size - 1}")
        return found

    return convert


def items_of(kind: Any) -> Callable:
    """Return a function that checks the items of an array member."""
    def convert(values: Any, what: str) -> Any:
        if isinstance(values, kind):
            return values
        values = tuple(values)
        if len(values) != kind._length_:
            raise refused(what, f"expected {kind._length_} items, got {len(values)}")
        item = converter(kind._type_)
        return kind(*(item(value, what) if item else value for value in values))

    return convert


def converter(kind: Any) -> Callable | None:
    """Return a function that checks values of a C type.

    Returns None for structs, whose type ctypes checks, and for addresses, which only this package sets.
    """
    if kind in INTEGERS:
        return integer_as(kind)
    if kind in REALS:
        return real
    if kind is ctypes.c_bool:
        return truth
    if kind is ctypes.c_char_p:
        return text
    if issubclass(kind, ctypes.Array):
        return texts_of(kind._length_) if kind._type_ is ctypes.c_char else items_of(kind)
    return None


def members_of(kind: Any) -> list[tuple[str, Any]]:
    """Return the names and types of a struct's members."""
    return [(member[0], member[1]) for member in kind._fields_]


def is_own(kind: Any) -> bool:
    """Return True for types of members that only this package sets: pointers, functions, structs with such members."""
    if issubclass(kind, ctypes.Structure):
        return any(is_own(member) for _, member in members_of(kind))
    return kind is ctypes.c_void_p or issubclass(kind, FUNCTION)


class Structure(ctypes.Structure):
    """A C struct that checks the values of its members when they are set."""

    _checks: dict = {}

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        cls._checks = {name: converter(kind) for name, kind in members_of(cls)}

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in self._checks:
            raise TypeError(f"{type(self).__name__} has no member {name!r}")
        check = self._checks[name]
        super().__setattr__(name, check(value, name) if check else value)


def checked(entry: Any, kinds: list, names: list) -> Any:
    """Return a wrapper of a C function that checks integers, reals, bools and texts."""
    found = [(i, converter(kind), name) for i, (kind, name) in enumerate(zip(kinds, names))]
    checks = [(i, check, name) for i, check, name in found if check]
    if not checks:
        return entry

    def function(*arguments: Any) -> Any:
        values = list(arguments)
        for i, check, name in checks:
            values[i] = check(values[i], name)
        return entry(*values)

    return function


def doubles(values: Any, what: str) -> np.ndarray:
    """Convert numbers to contiguous doubles; contiguous doubles are not copied. Wider floats are rounded."""
    if type(values) is np.ndarray and values.dtype == np.float64 and values.flags.c_contiguous:
        return values
    given = np.asarray(values)
    if given.dtype.kind == "O":
        given = np.array([real(value, what) for value in given.ravel()], np.float64).reshape(given.shape)
    if given.dtype.kind not in "fiu":
        raise TypeError(f"{what}: expected real numbers, got {given.dtype}")
    out = np.asarray(given, np.float64, order="C")
    if given.dtype.kind in "iu" and given.dtype.itemsize == 8 and given.size:
        for value in given[np.abs(out) >= 2.0**53].tolist():
            real(value, what)
    return np.where(np.ma.getmaskarray(values), np.nan, out) if np.ma.is_masked(values) else out


def integers(values: Any, dtype: Any, what: str) -> np.ndarray:
    """Convert integers to a contiguous array of a type that holds each. Raises TypeError for floats and bools."""
    given, range_ = np.asarray(values), np.iinfo(dtype)
    if np.ma.is_masked(values):
        raise refused(what, "masked integers have no value")
    if given.dtype.kind == "O":
        flat = [within(index_of(value, what), int(range_.min), int(range_.max), what) for value in given.ravel()]
        given = np.array(flat, dtype).reshape(given.shape)
    if given.dtype.kind not in "iu" and given.size:
        raise TypeError(f"{what}: expected integers, got {given.dtype}")
    if given.size:
        for value in (int(given.min()), int(given.max())):
            within(value, int(range_.min), int(range_.max), what)
    return np.ascontiguousarray(given, dtype=dtype)


def nanoseconds(seconds: Any, what: str = "deadline") -> int:
    """Return seconds as nanoseconds. Raises ArgumentError when they do not fit into 64 bits."""
    number = real(seconds, what)
    if not 0 <= number < 2**64 / 1e9:
        raise refused(what, f"{number} is not a valid time in seconds; give 0 or more")
    return int(number * 1e9)
