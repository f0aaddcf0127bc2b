"""The shared library: finding it, calling it, its errors, its memory, and views of its arrays."""
import ctypes
import functools
import glob
import json
import math
import operator
import os
import shutil
import threading
import weakref
from typing import Any, Optional

import numpy as np

from . import _binding as c
from ._binding import Status


class Error(Exception):
    """A function of the library failed. `status` says how; the text says what is wrong, where, with which value, and what would be right. `run`: what
    drape.run, Sim.record or Sim.view had recorded before, a drape.Run; None: it came from elsewhere, or before the first step."""

    status: Status = Status.E_ARGUMENT
    run: Any = None

    def __init__(self, message: str, status: Optional[Status] = None):
        super().__init__(message)
        if status is not None:
            self.status = status


class ArgumentError(Error, ValueError):
    """An invalid argument or scene value."""


class OutOfMemory(Error, MemoryError):
    """An allocation failed."""

    status = Status.E_MEMORY


class FileError(Error, OSError):
    """A file cannot be opened, read or written."""

    status = Status.E_FILE


class ParseError(Error, ValueError):
    """The text of a scene or mesh is malformed."""

    status = Status.E_PARSE


class StepError(Error, ArithmeticError):
    """No step could be made: too small a step, or too many. The sim is in the last accepted state."""

    status = Status.E_STEP_TOO_SMALL


class SolverError(StepError):
    """A step failed and no smaller one may be tried, or a solver cannot be set up."""

    status = Status.E_SOLVER


class VersionError(Error):
    """A file or a struct belongs to another version of Drape."""

    status = Status.E_VERSION


class Stopped(Error):
    """An observer or `Sim.cancel` asked to stop. The sim is in the last accepted state, from which it can go on."""

    status = Status.E_STOPPED


ERRORS = {kind.status: kind for kind in (ArgumentError, OutOfMemory, FileError, ParseError, StepError, SolverError, VersionError, Stopped)}


def error_of(status: int, message: str) -> Error:
    """The exception for a status."""
    return ERRORS.get(Status(status), Error)(message or Status(status).name.lower(), Status(status))


def _load() -> ctypes.CDLL:
    """$DRAPE_LIBRARY, or the library inside this package, or that of the system."""
    inside = sorted(glob.glob(os.path.join(os.path.dirname(os.path.abspath(__file__)), "libdrape.so.*")), key=len)
    library = ctypes.CDLL(os.environ.get("DRAPE_LIBRARY") or (inside[0] if inside else "libdrape.so.1"))
    library.drape_version.restype = ctypes.c_char_p
    version, expected = library.drape_version().decode(), f"{c.DRAPE_VERSION_MAJOR}.{c.DRAPE_VERSION_MINOR}."
    if not version.startswith(expected):
        raise ImportError(f"this package is for Drape {expected}*, and the library that was found is {version}: {library._name}")
    for name, (result, arguments) in c.FUNCTIONS.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


lib = _load()


def header(*names: str):
    """Decorator: adds the comments of these functions in drape.h to the documentation of a method."""

    def add(function):
        text = "\n\n".join(f"{name}: {c.DOCS[name]}" for name in names if name in c.DOCS)
        function.__doc__ = f"{function.__doc__ or ''}\n\nOf the C library:\n\n{text}"
        return function

    return add


# ---- Memory ----

_libc = ctypes.CDLL(None)
_libc.malloc.restype, _libc.malloc.argtypes = ctypes.c_void_p, (ctypes.c_size_t,)
_libc.free.restype, _libc.free.argtypes = None, (ctypes.c_void_p,)
_Allocate, _Release = (dict(c.drape_context_def._fields_)[name] for name in ("allocate", "release"))


class Memory:
    """The allocator of a context. A block that an array shows is not freed before the array is, whatever becomes of its sim: so no view of the
    library's arrays is ever left without memory. The library takes a few hundred blocks in all, none of them in a step."""

    def __init__(self):
        self.blocks, self.shown = {}, {}  # address: size; address: weak reference to what keeps the block
        self.views = {}  # (address, shape): an array that was made before, until any block is released
        blocks, shown, views, malloc, free = self.blocks, self.shown, self.views, _libc.malloc, _libc.free

        @_Allocate
        def allocate(_, size):
            address = malloc(size)
            if address:
                blocks[address] = size
            return address

        @_Release
        def release(_, address):
            blocks.pop(address, None)
            views.clear()
            kept = shown.pop(address, None)
            lease = kept and kept()
            if lease is None:
                free(address)
            else:
                lease.release_later(address)

        self.allocate, self.release = allocate, release

    def lease(self, address: int) -> Optional["Lease"]:
        """What an array at this address must keep alive; None: the address is not of this memory."""
        block = next((start for start, size in list(self.blocks.items()) if start <= address < start + size), None)
        if block is None:
            return None
        lease = self.shown.get(block)
        lease = lease and lease()
        if lease is None:
            lease = Lease()
            self.shown[block] = weakref.ref(lease)
        return lease


class Lease:
    """Keeps a block of memory for the arrays that show it."""

    __slots__ = ("__weakref__",)

    def release_later(self, address: int) -> None:
        weakref.finalize(self, _libc.free, address).atexit = False


class Context:
    """A context with its own memory and lock. The log goes to the Python logger "drape"."""

    def __init__(self):
        import logging
        logger = logging.getLogger("drape")
        self.memory = Memory()
        definition = c.drape_context_def()
        lib.drape_context_def_init(definition, ctypes.sizeof(definition))
        definition.allocate, definition.release = self.memory.allocate, self.memory.release
        definition.log = type(definition.log)(
            lambda _, level, text: logger.log(logging.WARNING if level else logging.INFO, "%s", text.decode(errors="replace")))
        self._definition = definition
        handle = ctypes.c_void_p()
        status = lib.drape_context_create(definition, handle)
        if status:
            raise error_of(status, "no context could be created")
        self.address = handle.value
        self.lock = threading.RLock()
        self.keep: list = []  # what must live as long as the context of the library
        weakref.finalize(self, _destroy, lib.drape_context_destroy, handle, (self.memory, definition, self.keep)).atexit = False

    def message(self) -> str:
        return lib.drape_context_message(self.address).decode(errors="replace")

    def check(self, status: int) -> None:
        if status:
            raise error_of(status, self.message())


def _destroy(function, handle, _keep):
    function(handle)


class Handle:
    """An object of the library and what it needs: freed when neither it nor anything made from it is in use, or by close(). needs are kept from outside
    of the collector's reach, so none may refer to what has the handle. When the interpreter ends nothing is freed: another thread may be using it."""

    def __init__(self, handle: ctypes.c_void_p, destroy, context: Context, *needs: Any):
        self.address, self.context = handle.value, context
        self.close = weakref.finalize(self, _destroy, destroy, handle, (context, *needs))
        self.close.atexit = False

    def view(self, address: int, shape, dtype) -> np.ndarray:
        """A read-only array of the library's memory, without a copy."""
        memory = self.context.memory
        array = memory.views.get((address, shape))
        if array is None:
            count = math.prod(shape)
            buffer = (ctypes.c_char * (count * np.dtype(dtype).itemsize)).from_address(address)
            buffer.keep = memory.lease(address)
            assert buffer.keep, "an array of another context"
            array = memory.views[address, shape] = np.frombuffer(memoryview(buffer).toreadonly(), dtype, count).reshape(shape)
        return array


# ---- Values in and out ----

@functools.lru_cache(maxsize=None)
def _reader(kind):
    """A function that makes a record of a struct."""
    record, parts = c.RECORDS[kind], []
    for name, ctype in kind._fields_:
        if ctype is ctypes.c_char_p or getattr(ctype, "_type_", None) is ctypes.c_char:
            parts.append((name, lambda text: text.decode(errors="replace") if text else ""))
        elif ctype in c.RECORDS:
            parts.append((name, _reader(ctype)))
        elif hasattr(ctype, "_length_"):
            parts.append((name, tuple))
        elif record.__annotations__.get(name) is Status:
            parts.append((name, Status))
        else:
            parts.append((name, None))
    return lambda struct: record._make([make(getattr(struct, name)) if make else getattr(struct, name) for name, make in parts])


def record(struct):
    """A named tuple with the values of a struct."""
    return _reader(type(struct))(struct)


def encode(text) -> Optional[bytes]:
    """A text or a path for the library; None stays None."""
    if text is None:
        return text
    if isinstance(text, (bytes, os.PathLike)):
        return _without_nul(os.fsencode(text))
    if not isinstance(text, str):
        raise TypeError(f"needs a text, has {type(text).__name__}: {text!r}")
    return _without_nul(text.encode())


def _without_nul(text: bytes) -> bytes:
    """The library's texts end at a NUL, so what has one would be cut."""
    if b"\0" in text:
        raise ArgumentError(f"{text.decode(errors='replace')!r}: a text or a name must not have a NUL character")
    return text


def file_name(path) -> bytes:
    """The name of a file for the library."""
    name = encode(path)
    if not name:
        raise ArgumentError("the name of the file is empty")
    return name


def check_finite(array: np.ndarray, name: str, given=None) -> None:
    """Refuses an array with a NaN or an infinity, and says where. given: the array as the caller had it, in which the number may be too large for this one."""
    if array.dtype.kind != "f" or np.isfinite(array).all():
        return
    at = tuple(np.argwhere(~np.isfinite(array))[0].tolist())
    place = f"[{', '.join(map(str, at))}]" if at else ""
    value = array[at] if given is None or given.shape != array.shape else given[at]
    raise ArgumentError(f"{name}{place}: {value:.9g} is not allowed; it must be finite" + (" and fit into single precision" if array.dtype.itemsize == 4 else ""))


def numbers(values, name: str, *shape, dtype=np.float64, finite: bool = True) -> np.ndarray:
    """A contiguous array of this shape; -1 stands for any length. Numbers that dtype cannot hold are refused, never wrapped or cut, and so are, if `finite`,
    NaN and infinities."""
    try:
        given = np.asarray(values)
        _check_shape(given, name, shape)  # before a conversion, for which there may be no memory
        _check_kind(given, name)
        if np.issubdtype(dtype, np.integer):
            array = _whole_numbers(given, name, dtype)
        elif np.iscomplexobj(given):
            raise TypeError(f"{name}: needs real numbers, has {given.dtype}")
        else:
            with np.errstate(over="ignore"):
                array = np.ascontiguousarray(given, dtype)
    except TypeError as error:
        raise TypeError(str(error) if str(error).startswith(name) else f"{name}: {error}") from None
    except Error:
        raise
    except (ValueError, OverflowError) as error:  # of numpy: texts, and lists of different lengths
        raise ArgumentError(f"{name}: {error}") from None
    if finite:
        check_finite(array, name, given)
    return array


def _check_shape(given: np.ndarray, name: str, shape) -> None:
    if given.ndim != len(shape) or any(want not in (-1, have) for want, have in zip(shape, given.shape)):
        wanted = " x ".join("n" if n == -1 else str(n) for n in shape)
        raise ArgumentError(f"{name}: has shape {given.shape}, needs {wanted}")


def _check_kind(given: np.ndarray, name: str) -> None:
    """numpy makes NaN of None, and numbers of texts."""
    if given.dtype.kind in "US" and given.size:
        raise ArgumentError(f"{name}: needs numbers, has the text {str(given.flat[0])!r}")
    if given.dtype == object and any(item is None for item in given.flat):
        raise TypeError(f"{name}: needs numbers, has None")


def given_array(values, name: str) -> np.ndarray:
    """An array as the caller has it."""
    try:
        return np.asarray(values)
    except ValueError as error:  # lists of different lengths
        raise ArgumentError(f"{name}: {error}") from None


def spread(values, name: str, *shape, finite: bool = True) -> np.ndarray:
    """Numbers of this shape, from those of one row or of one number for all; finite: as for `numbers`."""
    given = given_array(values, name)
    try:
        return numbers(np.broadcast_to(given, shape), name, *shape, finite=finite)
    except ValueError as error:
        if isinstance(error, Error):
            raise
        raise ArgumentError(f"{name}: has shape {given.shape}, needs {' x '.join(map(str, shape))}, or one for all") from None


def _whole_numbers(given: np.ndarray, name: str, dtype) -> np.ndarray:
    if given.dtype == object:  # numbers beyond 64 bits
        given = np.array([operator.index(item) for item in given.flat], object).reshape(given.shape)
    elif given.dtype.kind not in "iu" and given.size:
        raise ArgumentError(f"{name}: needs whole numbers, has {given.dtype}")
    limits = np.iinfo(dtype)
    for number in (given.min(), given.max()) if given.size else ():
        if not limits.min <= number <= limits.max:
            raise ArgumentError(f"{name}: {number} is not allowed; whole numbers are from {limits.min} to {limits.max}")
    return np.ascontiguousarray(given, dtype)


def whole(value, name: str) -> int:
    """A whole number that the library has room for."""
    if isinstance(value, (float, np.floating)):
        raise ArgumentError(f"{name}: needs a whole number, has {value}")
    try:
        return int(numbers([operator.index(value)], name, 1, dtype=np.int32)[0])
    except TypeError as error:
        raise TypeError(f"{name}: {error}") from None


def real(value, name: str) -> float:
    """A number; a text is none."""
    if isinstance(value, (str, bytes)):
        raise TypeError(f"{name}: needs a number, has the text {value!r}")
    try:
        return float(value)
    except TypeError:
        raise TypeError(f"{name}: needs a number, has {type(value).__name__}") from None
    except OverflowError as error:
        raise ArgumentError(f"{name}: {error}") from None


def instance(value, kind, name: str):
    """An object of a class of this package: of another, its address would be taken for what it is not."""
    if not isinstance(value, kind):
        raise TypeError(f"{name}: needs a drape.{kind.__name__}, has {type(value).__name__}")
    return value


def function_of(value, name: str):
    """Something that can be called."""
    if not callable(value):
        raise TypeError(f"{name}: needs a function, has {type(value).__name__}")
    return value


def indices(values, name: str, count: int) -> np.ndarray:
    """Node numbers: a single number, a sequence, or a mask of all count nodes."""
    array = np.atleast_1d(given_array(values, name))
    if array.dtype == bool:
        if array.shape != (count,):
            raise ArgumentError(f"{name}: a mask of shape {array.shape}, needs {count}")
        array = np.flatnonzero(array)
    return numbers(array, name, -1, dtype=np.int32)


def to_json(value) -> str:
    """JSON of a value, in which arrays and numbers of numpy may occur."""

    def plain(item):
        if isinstance(item, (np.ndarray, np.generic)):
            return item.tolist()
        if isinstance(item, os.PathLike):
            return os.fspath(item)
        raise ArgumentError(f"a scene cannot contain {type(item).__name__}")

    return json.dumps(value, default=plain)


def program() -> str:
    """The program `drape`: $DRAPE_PROGRAM, or that beside the running Python, or that on the path."""
    import sys
    import sysconfig
    named = os.environ.get("DRAPE_PROGRAM")
    beside = [os.path.join(folder, "drape") for folder in (os.path.dirname(sys.executable), sysconfig.get_path("scripts"))]
    for path in [named] if named else beside:
        if os.access(path, os.X_OK):
            return path
    found = shutil.which(named or "drape")
    if not found:
        raise FileError("the program drape was not found; set DRAPE_PROGRAM, or install it")
    return found
