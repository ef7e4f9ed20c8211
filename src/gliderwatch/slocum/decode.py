"""A file becomes a `Segment`, by dbdreader, which is imported only here and only in worker processes.

What dbdreader gets is never the file itself, but a copy in memory of its intact part, and a
private folder with the one cache file it needs: so it writes nothing beside the data (it keeps
the sensor list of an unfactored file as a cache file), reads the bytes that were checked, and
finds compressed files and cache files whatever their names. The result comes back as bytes of msgspec.
"""

from __future__ import annotations

import hashlib
import locale
import logging
import multiprocessing
import os
import resource
import signal
import tempfile
import warnings
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, InvalidStateError
from dataclasses import dataclass, replace
from functools import cache, partial
from math import prod
from pathlib import Path
from threading import Lock
from types import ModuleType
from typing import Any

import msgspec
import numpy as np
from pebble import ProcessExpired

from gliderwatch.errors import GliderwatchError, MissingCache, Quarantine, Retry
from gliderwatch.model import Segment
from gliderwatch.processes import Workers
from gliderwatch.slocum import folders
from gliderwatch.slocum.caches import Scratch, Staging, checksum
from gliderwatch.slocum.cycles import Sensors, intact, parse_sensor_list
from gliderwatch.slocum.folders import science_files
from gliderwatch.slocum.header import Header, parse_header, plain, read_regular
from gliderwatch.slocum.sensors import (
    PRESSURES,
    SCIENCE_SENSORS,
    SENSORS,
    TIME,
    Samples,
    build_segment,
    cleaned,
    tells_depth,
)

# ----------------------------------------
# What a worker process hands back to the daemon: a segment, or why there is none.
#
# MessagePack with the bytes of the arrays as they are, checked against the types of `Segment`. Not pickle:
# code of C that a damaged file leads astray may have written over the memory of the worker, and a pickle is
# a program that the daemon would run.

_ERRORS: dict[str, type[GliderwatchError]] = {e.__name__: e for e in (Retry, MissingCache, Quarantine)}


class _Decoded(msgspec.Struct, tag=True):
    segment: Segment


class _Array(msgspec.Struct):
    shape: list[int]
    f64: bytes


class _Failed(msgspec.Struct, tag=True):
    kind: str
    arguments: list[Any]


def encoded(outcome: Segment | GliderwatchError) -> bytes:
    """A segment, or an error of `decode`, as bytes. Raises TypeError for anything else."""
    if isinstance(outcome, GliderwatchError):
        kind = type(outcome).__name__
        arguments = outcome.__reduce__()[1] if kind in _ERRORS else (str(outcome),)
        return msgspec.msgpack.encode(_Failed(kind, [_printable(a) for a in arguments]))
    if not isinstance(outcome, Segment):
        raise TypeError(f"no segment but {type(outcome).__name__}")
    return msgspec.msgpack.encode(_Decoded(outcome), enc_hook=_from_array)


def decoded(data: bytes) -> Segment | GliderwatchError:
    """What `encoded` made into bytes, to the last bit; arrays are read-only.

    An error of another kind than `Retry`, `MissingCache` and `Quarantine` comes back as Quarantine. Raises
    ValueError for bytes that `encoded` did not make.
    """
    found = msgspec.msgpack.decode(data, type=_Decoded | _Failed, dec_hook=_to_array)
    if isinstance(found, _Decoded):
        return found.segment
    try:
        return _ERRORS.get(found.kind, Quarantine)(*found.arguments)
    except TypeError as error:
        raise ValueError(f"no {found.kind}: {error}") from None


def _printable(argument: Any) -> Any:
    """Names of files may hold bytes that are no UTF-8."""
    if isinstance(argument, str):
        return argument.encode("utf-8", "backslashreplace").decode()
    return [_printable(a) for a in argument]


def _from_array(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype == np.float64:
        return _Array(list(value.shape), np.ascontiguousarray(value, dtype="<f8").tobytes())
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"no way to hand over {type(value).__name__}")


def _to_array(kind: Any, value: Any) -> Any:
    """Raises TypeError or ValueError, of which msgspec makes a ValidationError (a ValueError)."""
    array = msgspec.convert(value, _Array)
    if prod(array.shape) * 8 != len(array.f64):
        raise ValueError("an array of another size than its shape")
    return np.frombuffer(array.f64, dtype="<f8").reshape(array.shape)  # of bytes, so read-only


# ----------------------------------------
# A file becomes a `Segment`, by dbdreader, which is imported only here and only in worker processes.
#
# What dbdreader gets is never the file itself, but a copy in memory of its intact part, and a
# private folder with the one cache file it needs: so it writes nothing beside the data (it keeps
# the sensor list of an unfactored file as a cache file), reads the bytes that were checked, and
# finds compressed files and cache files whatever their names.

_LARGEST = 512 * 1024 * 1024
_SCIENCE_TIME = "sci_m_present_time"
_staging = cache(Staging)


def decode(path: Path, cache_folders: Sequence[Path], *, science: Sequence[str] | None = None) -> Segment:
    """The segment that the file at `path` holds; of a cut or damaged file its intact part.

    With `science` it has the quantities of the science file beside it too, if that is there by now: those of
    `sensors.SCIENCE`, and of the sensors named there, by their own names as they are sent.

    Raises `MissingCache` (a `Retry`) while the cache file of a factored header is in none of
    `cache_folders`, `Retry` for what may pass, `Quarantine` for a file that is no use as it is.
    """
    of_science = () if science is None else _with_own(science)
    try:
        content = _content(path, cache_folders, TIME, (*SENSORS, *of_science))
        header, n_cycles, samples, digest = content.header, content.n_cycles, content.samples, content.digest
        if n_cycles and (of_science or not tells_depth(samples)):
            beside = _science(path, header, cache_folders, of_science or PRESSURES[-1:])
            if beside is not None:
                n_cycles += beside.n_cycles  # with it the copy holds more
                samples = {**beside.samples, **samples}
                digest.update(beside.digest.digest())
    except OSError as error:
        raise Retry(f"cannot be read: {error}") from error
    completeness = (folders.rank(header.kind), n_cycles, digest.hexdigest())
    segment = build_segment(header, samples, completeness, content.damaged, science=science is not None)
    return _own(segment, samples, science or ())


def decode_science(path: Path, cache_folders: Sequence[Path], *, science: Sequence[str] = ()) -> Segment:
    """What the science file at `path` holds, without the flight file beside it: the quantities of
    `sensors.SCIENCE`, and of the sensors named in `science`. Raises as `decode`."""
    try:
        content = _content(path, cache_folders, _SCIENCE_TIME, _with_own(science), science=True)
    except OSError as error:
        raise Retry(f"cannot be read: {error}") from error
    completeness = (folders.rank(content.header.kind), content.n_cycles, content.digest.hexdigest())
    segment = build_segment(content.header, content.samples, completeness, content.damaged, science=True)
    return _own(segment, content.samples, science)


def _with_own(science: Sequence[str]) -> tuple[str, ...]:
    """The sensors of `sensors.SCIENCE` and those named, each once."""
    return (*SCIENCE_SENSORS, *(name for name in science if name not in SCIENCE_SENSORS))


def _own(segment: Segment, samples: Samples, science: Sequence[str]) -> Segment:
    """The segment with the sensors named, as far as they were sent, by their own names and in their units."""
    own = {name: cleaned(samples[name]) for name in science if name in samples}
    return replace(segment, quantities={**segment.quantities, **own}) if own else segment


@dataclass(frozen=True, slots=True)
class _Content:
    """What one file holds: intact cycles, their samples, and their ``digest``; bytes ``damaged``."""

    header: Header
    n_cycles: int
    samples: Samples
    digest: Any
    damaged: int


def _science(
    path: Path, header: Header, cache_folders: Sequence[Path], sensors: Sequence[str]
) -> _Content | None:
    """What the science file beside a flight file says of some sensors; None where none of the same segment
    says anything.

    What is wrong with it is no reason to do without the flight file.
    """
    for beside in science_files(path):
        try:
            found = _content(beside, cache_folders, _SCIENCE_TIME, sensors, science=True)
        except (GliderwatchError, OSError):
            continue
        if found.header.id.name == header.id.name and any(len(t) for t, _ in found.samples.values()):
            return found
    return None


def _content(
    path: Path, cache_folders: Sequence[Path], time: str, wanted: Sequence[str], *, science: bool = False
) -> _Content:
    """The intact part of a file: of its sensors those `wanted`, by its sensor `time`."""
    data, _ = read_regular(path, _LARGEST)
    data = plain(data, _LARGEST)
    header = parse_header(data, science=science)
    if header.factored:
        staged = _staging().get(header, cache_folders)
        return _decode(data, header, header.length, staged.sensors, staged.folder, time, wanted)
    sensors, start = _own_list(data, header)
    with tempfile.TemporaryDirectory() as folder:
        return _decode(data, header, start, sensors, Path(folder), time, wanted)


def _own_list(data: bytes, header: Header) -> tuple[Sensors, int]:
    try:
        sensors, start = parse_sensor_list(data, header.length, header.n_sensors)
    except ValueError as error:
        raise Quarantine(f"cut or damaged in its sensor list: {error}") from error
    if int(checksum(data[header.length : start]), 16) != int(header.crc, 16):
        raise Quarantine("damaged in its sensor list: it has not the checksum that the header says")
    if len(sensors.names) != header.n_held:
        raise Quarantine("damaged: header and sensor list hold different numbers of sensors")
    return sensors, start


def _decode(
    data: bytes,
    header: Header,
    start: int,
    sensors: Sensors,
    folder: Path,
    time: str,
    wanted: Sequence[str],
) -> _Content:
    if time not in sensors.names:
        raise Quarantine(f"holds no {time}: nothing in it has a time")
    try:
        n_cycles, end, damaged = intact(data, start, sensors)
    except ValueError as error:
        raise Quarantine(f"damaged: {error}") from error
    if damaged and not n_cycles:
        raise Quarantine("damaged: not one intact cycle of values in it")
    # The hash leaves out what was lost, so that equal content is equal in every copy of a segment.
    content = memoryview(data)[:end]
    held = [name for name in wanted if name in sensors.names]
    samples = _read(content, held, folder) if n_cycles and held else {}
    return _Content(header, n_cycles, samples, hashlib.sha256(content), damaged)


def _read(content: memoryview, wanted: Sequence[str], folder: Path) -> Samples:
    """Times and values by sensor, in the glider's units, of the sensors wanted, which the file holds."""
    with os.fdopen(os.memfd_create("segment", os.MFD_CLOEXEC), "wb") as file:
        file.write(content)
        file.flush()
        # Without a suffix of three letters dbdreader 0.6.3 reads memory that is not its own.
        link = folder / "segment.dbd"
        link.symlink_to(f"/proc/self/fd/{file.fileno()}")
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                dbd = _dbdreader().DBD(str(link), cacheDir=str(folder))
                result = dbd.get(*wanted, decimalLatLon=False, discardBadLatLon=False)
        finally:
            link.unlink()
    return dict(zip(wanted, result if len(wanted) > 1 else [result], strict=True))


@cache
def _dbdreader() -> ModuleType:
    """dbdreader, kept from what it does when imported: a folder below HOME, another locale, a noisy log."""
    home, language = os.environ.get("HOME"), locale.setlocale(locale.LC_ALL)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["HOME"] = folder
        try:
            import dbdreader  # type: ignore[import-untyped]  # noqa: PLC0415 (costs, and changes the process)
        finally:
            del os.environ["HOME"]
            if home is not None:
                os.environ["HOME"] = home
            locale.setlocale(locale.LC_ALL, language)
    logging.getLogger("dbdreader.py").setLevel(logging.CRITICAL)
    module: ModuleType = dbdreader
    return module


# --------------------------------------------------------------------------- worker processes

Decode = Callable[..., Segment]
"""Of a path and cache folders, as `decode`; with `science` only where that is wanted."""


class Decoder:
    """Decodes in worker processes: whatever a file makes dbdreader do, the daemon lives and goes on.

    A task may take `timeout` seconds and one more for each MB, a worker `memory` bytes of
    address space. `cache_folders` and `science` may be replaced at any time.
    """

    def __init__(
        self,
        cache_folders: Sequence[Path],
        *,
        max_workers: int = 1,
        timeout: float = 60.0,
        memory: int = 2 * 1024**3,
        decode: Decode = decode,
    ) -> None:
        self.cache_folders = tuple(cache_folders)
        self._max_workers, self._timeout, self._memory, self._decode = max_workers, timeout, memory, decode
        self._scratch = Scratch()
        self._lock = Lock()
        self.science: Sequence[str] | None = None
        """As in `decode`: None where segments are not to have what their science files hold."""
        self._closed = False
        self._pending: set[Future[Segment]] = set()
        # Workers inherit it; nothing here gains from threads of linear algebra.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        self._pool = self._new_pool()

    def __enter__(self) -> Decoder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def submit(self, path: Path) -> Future[Segment]:
        """The segment of `path` to come; its exception, if any, is a `Retry` or a `Quarantine`.

        The future is cancelled when the decoder is closed first. Raises `RuntimeError` after that.
        """
        seconds = self._timeout + _megabytes(path)
        decode = self._decode if self.science is None else partial(self._decode, science=tuple(self.science))
        args = (decode, path, self.cache_folders, seconds)
        outer: Future[Segment] = Future()
        with self._lock:
            if self._closed:
                raise RuntimeError("the decoder is closed")
            try:
                inner = self._pool.schedule(_work, args=args)
            except RuntimeError:  # the pool gives up for good when a worker dies that has nothing to do
                self._pool.end()
                self._pool = self._new_pool()
                inner = self._pool.schedule(_work, args=args)
            self._pending.add(outer)
        outer.add_done_callback(self._pending.discard)
        inner.add_done_callback(partial(_resolve, outer, seconds))
        return outer

    def map(
        self, paths: Iterable[Path], ahead: int = 32
    ) -> Iterator[tuple[Path, Segment | GliderwatchError]]:
        """Each path with its segment or with what is wrong, in order; works `ahead` of the caller."""
        waiting: deque[tuple[Path, Future[Segment]]] = deque()
        for path in paths:
            waiting.append((path, self.submit(path)))
            if len(waiting) >= ahead:
                yield _outcome(*waiting.popleft())
        while waiting:
            yield _outcome(*waiting.popleft())

    def close(self) -> None:
        """Ends the workers at once, whatever they do."""
        with self._lock:
            self._closed = True
        for future in tuple(self._pending):  # before the workers end: that would be a result of theirs
            future.cancel()
        self._pool.end()
        self._scratch.cleanup()

    def _new_pool(self) -> Workers:
        pool = Workers(self._max_workers, _prepare, (self._scratch.name, self._memory))
        if not pool.active:  # asking starts the workers, so that the first file does not wait for them
            raise RuntimeError("the worker processes of the decoder cannot be started")
        return pool


def _prepare(scratch: str, memory: int) -> None:
    """What a worker does before its first task."""
    tempfile.tempdir = scratch
    for kind, limit in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (limit if hard < 0 else min(limit, hard), hard))
    parent = multiprocessing.parent_process()
    try:
        _dbdreader()
    except OSError:
        if parent is None or parent.is_alive():
            raise
        os._exit(1)  # the daemon was killed meanwhile, and the next one has removed the scratch folder


def _work(decode: Decode, path: Path, cache_folders: Sequence[Path], seconds: float) -> bytes:
    """The segment or the exception, as bytes (`worker_result`).

    Its own alarm ends a worker that takes too long, also when nobody is there any more to end it.
    """
    signal.setitimer(signal.ITIMER_REAL, seconds)
    why: GliderwatchError
    try:
        return encoded(decode(path, cache_folders))
    except GliderwatchError as error:
        why = error
    except MemoryError:
        why = Quarantine("takes more memory to decode than a segment may")
    except BaseException as error:
        why = Quarantine(f"cannot be decoded ({type(error).__name__}: {str(error)[:200]})")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    return encoded(why)


def _resolve(outer: Future[Segment], seconds: float, inner: Future[bytes]) -> None:
    """Hands over what a worker returned, or says in words how it ended."""
    outcome: Segment | GliderwatchError
    try:
        outcome = decoded(inner.result())
    except ProcessExpired as error:
        outcome = _ended(-error.exitcode, seconds)
    except ValueError:
        outcome = Quarantine("the decoder handed back something that is no segment")
    except BaseException as error:
        outcome = Retry(f"the decoder was interrupted ({type(error).__name__})")
    try:
        if isinstance(outcome, GliderwatchError):
            outer.set_exception(outcome)
        else:
            outer.set_result(outcome)
    except InvalidStateError:
        pass  # cancelled meanwhile


def _ended(number: int, seconds: float) -> GliderwatchError:
    if number == signal.SIGALRM:
        return Quarantine(f"decoding took longer than {seconds:.0f} s and was ended")
    if number in (signal.SIGTERM, signal.SIGKILL, signal.SIGHUP):
        return Retry("the decoder was ended from outside")
    name = signal.Signals(number).name if number in set(signal.Signals) else f"exit code {-number}"
    return Quarantine(f"the decoder crashed on it ({name})")


def _outcome(path: Path, future: Future[Segment]) -> tuple[Path, Segment | GliderwatchError]:
    try:
        return path, future.result()
    except GliderwatchError as error:
        return path, error


def _megabytes(path: Path) -> float:
    try:
        return min(path.lstat().st_size, _LARGEST) / 1e6  # what is larger is refused without reading it
    except OSError:
        return 0.0
