"""A from-glider folder as an enemy, a broken disk or a bad line would fill it."""

from __future__ import annotations

import os
import random
import socket
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import lz4.block

import bad_decode
from gliderwatch.slocum.decode import decode

_PROGRAM = """
import functools, sys
sys.path[:0] = {folders!r}
from acceptance.hostile import misbehave
from gliderwatch.service import runtime
runtime.Decoder = functools.partial(runtime.Decoder, decode=misbehave, timeout={timeout})
from gliderwatch.cli.main import main
if __name__ == "__main__":
    main()
"""

_MISDEEDS = ("hang", "hang-in-c", "crash", "exit", "memory", "error")
_HUGE = 1 << 30


def program(timeout: float = 2.0) -> str:
    """The command as installed, but for a decoder that does to its worker what the name of a file says,
    and may take `timeout` seconds."""
    return _PROGRAM.format(folders=[str(Path(__file__).parents[1])], timeout=timeout)


def misbehave(path: Path, caches: Sequence[Path]) -> object:
    """Decodes, unless the name ends in `+hang`, `+crash`, ...: then the worker suffers that."""
    misdeed = path.stem.rpartition("+")[2]
    return bad_decode.misbehave(Path(misdeed), caches) if misdeed in _MISDEEDS else decode(path, caches)


def fill(folder: Path, whole: Sequence[bytes], n: int, seed: int) -> list[str]:
    """Put `n` hostile entries into a folder, made of whole files; their names, each to be in the ledger."""
    rng = random.Random(seed)
    outside = folder.parents[2] / "outside.sbd"
    outside.write_bytes(whole[0])
    kinds = [_damaged] * 24 + [_odd_name] * 6 + [_no_data] * 6 + [_no_file] * 9 + [_misdeed]
    first = [_huge, _bomb, *[_misdeed] * len(_MISDEEDS)]
    makers = first + [rng.choice(kinds) for _ in range(n - len(first))]
    return [make(folder, rng.choice(whole), i, rng) for i, make in enumerate(makers)]


def shown(name: str) -> str:
    """A name as the ledger has it."""
    return name.encode("utf-8", "backslashreplace").decode()


def _put(folder: Path, name: str, data: bytes) -> str:
    (folder / name).write_bytes(data)
    return name


def _name(i: int, rng: random.Random) -> str:
    return rng.choice([f"{i:08d}", f"angus-2024-121-7-{i}"]) + rng.choice([".sbd", ".SBD", ".scd", ".dbd"])


def _damaged(folder: Path, whole: bytes, i: int, rng: random.Random) -> str:
    data = bytearray(whole)
    for _ in range(rng.choice([1, 1, 2])):
        at = rng.randrange(max(len(data), 1))
        match rng.randrange(7):
            case 0:
                del data[at:]
            case 1:
                data[at : at + 1] = rng.randbytes(1)
            case 2:
                at = rng.randrange(600)
                data[at : at + 1] = rng.choice([b"\n", b"\0", b"9", b" ", b"\xff", b"\x1b"])
            case 3:
                data[at:at] = rng.randbytes(rng.choice([1, 50, 5000]))
            case 4:
                del data[at : at + rng.choice([1, 4, 200])]
            case 5:
                data += bytes(rng.choice([1, 1000, 100_000]))
            case _:
                data = bytearray(_packed(bytes(data)))
    return _put(folder, _name(i, rng), bytes(data))


def _no_data(folder: Path, whole: bytes, i: int, rng: random.Random) -> str:
    noise = rng.randbytes(rng.choice([1, 70, 3000]))
    data = rng.choice([b"", noise, b"\0" * 4096, b"<script>alert(1)</script>", b"dbd_label:" + noise])
    return _put(folder, _name(i, rng), data)


def _odd_name(folder: Path, whole: bytes, i: int, rng: random.Random) -> str:
    odd = ["\n[FAKE] line", "\x1b[2J\x1b[31m", "\x1b]0;title\x07", "\r\nBcc: x@y.z", "<script>", "<!channel>"]
    odd += ["*_~`", "$(touch x)", "'; DROP TABLE files; --", "\u202e", os.fsdecode(b"\xff\xfe"), " ", "%s%n"]
    return _put(folder, f"{i}{rng.choice(odd)}.sbd", rng.choice([whole, whole[:500], b""]))


def _no_file(folder: Path, whole: bytes, i: int, rng: random.Random) -> str:
    name = _name(i, rng)
    path = folder / name
    makers: list[Callable[[], object]] = [
        path.mkdir,
        lambda: os.mkfifo(path),
        lambda: _socket(path),
        lambda: path.symlink_to(folder.parents[2] / "outside.sbd"),
        lambda: path.symlink_to("nowhere.sbd"),
        lambda: path.symlink_to(name),
        lambda: path.symlink_to(folder),
        lambda: path.symlink_to("/dev/zero"),
        lambda: path.symlink_to("/etc/passwd"),
    ]
    rng.choice(makers)()
    return name


def _socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as sock:
        here = os.open(path.parent, os.O_PATH)
        try:  # the address of a socket may not be as long as a path
            sock.bind(f"/proc/self/fd/{here}/{path.name}")
        finally:
            os.close(here)


def _misdeed(folder: Path, whole: bytes, i: int, rng: random.Random) -> str:
    return _put(folder, f"{i}+{_MISDEEDS[i % len(_MISDEEDS)]}.sbd", whole)


def _huge(folder: Path, whole: bytes, i: int, rng: random.Random) -> str:
    """A file of 1 GB that begins well; it takes no room on the disk."""
    name = _put(folder, f"{i}-huge.sbd", whole)
    os.truncate(folder / name, _HUGE)
    return name


def _bomb(folder: Path, whole: bytes, i: int, rng: random.Random) -> str:
    """3 MB that are 700 MB when decompressed."""
    zeros = _packed(bytes(32768))
    return _put(folder, f"{i}-bomb.scd", _packed(whole[:32768]) + zeros * 22_000)


def _packed(data: bytes) -> bytes:
    return b"".join(_blocks(data))


def _blocks(data: bytes) -> Iterator[bytes]:
    for i in range(0, len(data), 32768):
        block = lz4.block.compress(data[i : i + 32768], store_size=False)
        yield len(block).to_bytes(2, "big") + block


# --------------------------------------------------------------------------- memory


def peak(pid: int) -> float:
    """The most memory (MB) that a process ever had resident; 0 once it has gone."""
    return _status(pid, "VmHWM")


def workers(pid: int) -> float:
    """The memory (MB) that all children of a process have resident together, as of now."""
    try:
        tasks = list(Path(f"/proc/{pid}/task").iterdir())
        children = [int(c) for task in tasks for c in (task / "children").read_text().split()]
    except OSError:
        return 0.0
    return sum(_status(child, "VmRSS") + workers(child) for child in children)


def _status(pid: int, key: str) -> float:
    try:
        lines = Path(f"/proc/{pid}/status").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return 0.0
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith(key)), 0.0)
