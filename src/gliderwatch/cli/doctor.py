"""`gliderwatch doctor`: what a technician would check, in order, each with the cure."""

from __future__ import annotations

import grp
import os
import platform
import pwd
import shutil
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path

from gliderwatch import __version__
from gliderwatch.cli import doctor_checks
from gliderwatch.cli.doctor_checks import (
    Finding,
    Findings,
    as_lines,
    error,
    exit_code,
    note,
    ok,
    report,
    summary,
    warning,
)
from gliderwatch.config import Config, Problem, expand, load
from gliderwatch.errors import ConfigError
from gliderwatch.messages.formatting import duration, utc
from gliderwatch.service import preconditions

# ----------------------------------------
# The machine: program, user and groups, limits of inotify, clock, disk.

PYTHON = (3, 11)
_LIMITS = Path("/proc/sys/fs/inotify")
_MOUNTS = Path("/proc/self/mountinfo")
_MOST = 1_000_000
"""Folders that are counted at the most."""
_REMOTE = ("nfs", "cifs", "smb", "fuse.sshfs", "9p", "afs", "ceph", "glusterfs", "lustre")
_FULL = 0.8
_GROUP_BITS = {"r": stat.S_IRGRP, "x": stat.S_IXGRP}
_PRIVILEGED = frozenset(
    {"adm", "admin", "daemon", "disk", "docker", "incus-admin", "kmem", "libvirt", "lxd", "root", "shadow"}
    | {"ssl-cert", "staff", "sudo", "sys", "systemd-journal", "wheel"}
)
"""Groups whose members may do more than read the files of a dockserver."""
_RELEASED = 1_767_225_600.0
"""2026-01-01: a clock before it is wrong."""
_LATE = 300.0
"""Seconds by which a file may be dated in the future."""


def program() -> Findings:
    """Version and Python."""
    text = f"gliderwatch {__version__}, Python {platform.python_version()}, {sys.platform}"
    if sys.version_info[:2] < PYTHON:
        yield error("program", text, "install Python 3.11 or later")
    else:
        yield ok("program", f"{text} {platform.machine()}")


def user(config: Config) -> Findings:
    """Who asks, and whether the groups of the folders are among his."""
    name, mine = _name(os.geteuid()), {os.getegid(), *os.getgroups()}
    groups = ", ".join(sorted(map(_group, mine)))
    if os.geteuid() == 0:
        yield note(
            "user",
            "root may read everything: this says nothing of what the service can read",
            "ask as its user: sudo -u gliderwatch gliderwatch doctor ...",
        )
    else:
        yield ok("user", f"{name}, groups {groups}")
    patterns = [*config.dockserver.roots, *config.dockserver.cache]
    patterns += [path for glider in config.gliders.values() for path in glider.paths]
    closed: dict[Path, Finding] = {}
    for folder in expand(patterns):
        for part in (*reversed(folder.parents), folder):
            needed = "x" if part != folder else "rx"
            if not os.access(part, os.X_OK if part != folder else os.R_OK | os.X_OK):
                closed.setdefault(part, _closed(part, needed, name, mine))
                break
    yield from closed.values()


def _closed(folder: Path, needed: str, name: str, mine: Collection[int]) -> Finding:
    """Why a folder is closed to the user `name` with the groups `mine`, and what opens it.

    Nobody is to join a group that may do more than read data: there an access control list lets him in.
    """
    try:
        status = folder.stat()
    except OSError as problem:
        cure = "correct the path in the configuration, or mend the link"
        return error("user", f"{folder} cannot be looked at: {problem.strerror}", cure)
    gid, group, mode = status.st_gid, _group(status.st_gid), stat.S_IMODE(status.st_mode)
    is_open = all(mode & _GROUP_BITS[bit] for bit in needed)
    if status.st_uid == os.geteuid():
        return error("user", f"{folder} is closed to its owner {name}", f"chmod u+{needed} {folder}")
    if gid in mine and not is_open:
        return error("user", f"{folder} is closed to its group {group}", f"chmod g+{needed} {folder}")
    if gid in mine or gid == 0 or group in _PRIVILEGED or not is_open:
        owner = f"{_name(status.st_uid)}:{group}, mode {mode:04o}"
        return error("user", f"{folder} ({owner}) is closed to {name}", _acl(folder, needed, name))
    if gid in os.getgrouplist(name, os.getegid()):
        text = f"{name} is in group {group} of {folder}, but not yet here"
        return error("user", text, "log in again; restart the service")
    return error(
        "user",
        f"{name} is not in group {group}, which {folder} belongs to",
        f"SupplementaryGroups={group} in the unit (systemctl edit gliderwatch), or "
        f"usermod -aG {group} {name}",
    )


def _acl(folder: Path, needed: str, name: str) -> str:
    """The command that lets one user through a folder, or read all that is and will be in it."""
    who = f"u:{name}"
    if needed == "x":
        return f"setfacl -m {who}:x {folder}"
    return f"setfacl -R -m {who}:rX {folder}; setfacl -R -d -m {who}:rX {folder}"


def inotify(config: Config) -> Findings:
    """Whether the kernel allows as many watches as there are folders, and sees what comes."""
    if config.dockserver.observer == "polling":
        yield ok("inotify", "not used (observer: polling)")
        return
    roots = expand(config.dockserver.roots)
    roots += expand(path for glider in config.gliders.values() for path in glider.paths)
    for root in roots:
        kind = _file_system(root)
        if kind.startswith(_REMOTE):
            text = f"{root} is a share ({kind}): what other machines write there goes unseen"
            yield warning("inotify", text, "set observer: polling under dockserver")
    needed = sum(1 for root in roots for _ in islice(_folders(root), _MOST)) + len(config.dockserver.cache)
    allowed, instances = _limit("max_user_watches"), _limit("max_user_instances")
    if allowed is None or instances is None:
        yield note("inotify", f"the limits cannot be read in {_LIMITS}")
    elif needed > _FULL * allowed:
        cure = f"sysctl fs.inotify.max_user_watches={2 * max(needed, allowed)}, and in /etc/sysctl.d/"
        text = f"{needed} folders to watch, {allowed} watches allowed for all programs of this user"
        yield (error if needed > allowed else warning)("inotify", text, cure)
    elif instances < 1:
        yield error("inotify", "no instance allowed", "sysctl fs.inotify.max_user_instances=128")
    else:
        yield ok("inotify", f"{needed} folders to watch, {allowed} watches allowed")


def clock(newest: Mapping[Path, float], now: float | None = None) -> Findings:
    """Whether the clock can be right. `newest` files and when they were last written (s)."""
    now = time.time() if now is None else now
    if now < _RELEASED:
        yield error("clock", f"this machine says it is {utc(now)}", "set the clock; install chrony")
        return
    ahead = {path: t - now for path, t in newest.items() if t - now > _LATE}
    if ahead:
        path = max(ahead, key=lambda p: ahead[p])
        text = f"{path} is dated {duration(ahead[path])} in the future"
        yield warning("clock", text, "set the clocks of this machine and of the dockserver by NTP")
    synchronised = _ntp()
    if synchronised == "no":
        cure = "timedatectl set-ntp true; timedatectl timesync-status, or chronyc tracking"
        yield warning("clock", "not synchronised by NTP", cure)
    elif synchronised == "yes":
        yield ok("clock", f"{utc(now)}, synchronised by NTP")
    else:
        yield note("clock", f"{utc(now)}; whether it is synchronised cannot be told here (no timedatectl)")


def disk(config: Config, least_mb: float) -> Findings:
    """Room for the state file and for decoding."""
    state = Path(config.state.path)
    folder = next(parent for parent in state.parents if parent.is_dir())
    free = shutil.disk_usage(folder).free / 1e6
    status = os.statvfs(folder)
    if status.f_flag & os.ST_RDONLY:
        yield error("disk", f"{folder} is on a read-only file system", "choose another state.path")
    elif free < least_mb:
        text = f"{free:.0f} MB free in {folder}, less than {least_mb:g} MB"
        yield warning("disk", text, "make room, or choose another state.path")
    elif status.f_files and not status.f_favail:
        yield error("disk", f"no more files can be made in {folder} (inodes)", "remove files there")
    else:
        yield ok("disk", f"{free:.0f} MB free in {folder}")
    try:
        with tempfile.TemporaryFile():
            return
    except OSError as problem:
        text = f"no temporary file can be made: {problem.strerror}"
        yield error("disk", text, "make room in /tmp, or set TMPDIR; files cannot be decoded without")


def _name(uid: int) -> str:
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return str(uid)


def _group(gid: int) -> str:
    try:
        return grp.getgrgid(gid).gr_name
    except KeyError:
        return str(gid)


def _limit(name: str) -> int | None:
    try:
        return int((_LIMITS / name).read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None


def _folders(root: Path) -> Iterable[str]:
    return (folder for folder, _, _ in os.walk(root))


def _file_system(path: Path) -> str:
    """The kind of file system that a path is on; empty where that is not known."""
    best, kind = -1, ""
    try:
        lines = _MOUNTS.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    for line in lines:
        left, _, right = line.partition(" - ")
        place = left.split()[4].replace("\\040", " ")
        if path.is_relative_to(place) and len(place) > best:
            best, kind = len(place), right.split()[0]
    return kind


def _ntp() -> str | None:
    """`yes` or `no` as timedatectl tells, None where it does not."""
    command = ["timedatectl", "show", "--property=NTPSynchronized", "--value"]
    try:
        result = subprocess.run(command, capture_output=True, text=True, timeout=10, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return result.stdout.strip() if result.stdout.strip() in {"yes", "no"} else None


# ----------------------------------------
# `gliderwatch doctor`: what a technician would check, in order, each with the cure.
#
# Nothing is written (SQLite may put its `-shm` beside the state file to read it), and nothing is sent unless
# asked for. What can be read depends on the user: ask as the one that runs the service.

__all__ = ["Finding", "as_lines", "examine", "exit_code", "report", "summary"]


def examine(path: Path, *, send: bool = False) -> Iterator[Finding]:
    """All findings with the configuration at `path`; `send` a test message through each channel."""
    yield from _safely("program", program)
    try:
        config = load(path)
    except (ConfigError, OSError) as problem:
        for line in str(problem).splitlines():
            yield error("configuration", line, "gliderwatch check -c FILE; docs/configuration.md")
        yield from _safely("clock", lambda: clock({}))
        return
    yield ok("configuration", f"{path} can be read, {len(config.gliders)} gliders")
    problems: list[Problem] = []
    yield from _safely("folders", lambda: _checked(config, path, problems))
    yield from _safely("user", lambda: user(config))
    yield from _safely("inotify", lambda: inotify(config))
    files = doctor_checks.Inventory()
    yield from _safely("files", lambda: _counted(config, files))
    yield from _safely("files", lambda: doctor_checks.names(config, files))
    yield from _safely("caches", lambda: doctor_checks.caches(config, files))
    yield from _safely("sensors", lambda: doctor_checks.sensors(config, files))
    yield from _safely("clock", lambda: clock(files.newest))
    least = config.operator.free_mb or 0.0
    yield from _safely("disk", lambda: disk(config, least))
    yield from _safely("state", lambda: doctor_checks.state(config, problems))
    yield from _safely("channels", lambda: doctor_checks.channels(config, problems, send))
    yield from _safely("relays", lambda: doctor_checks.relays(config, problems))
    yield from _safely("heartbeat", lambda: doctor_checks.sign(config, problems))
    yield from _safely("service", lambda: doctor_checks.daemon(config))


def _safely(topic: str, look: Callable[[], Iterable[Finding]]) -> Iterator[Finding]:
    """The findings of one part; what nobody foresaw in it hides nothing of the others."""
    try:
        yield from look()
    except Exception as problem:
        text = f"could not be looked at: {type(problem).__name__}: {problem}"
        yield error(topic, text, "if it says nothing to you, please report it")


def _checked(config: Config, path: Path, problems: list[Problem]) -> Iterator[Finding]:
    """Folders and permissions; `problems` gets all that `check` finds."""
    problems += preconditions.check(config, path)
    found = doctor_checks.of_check("folders", problems, "dockserver", "gliders", "pages", "maps")
    yield from found or [ok("folders", "all are there and can be read")]


def _counted(config: Config, files: doctor_checks.Inventory) -> Iterator[Finding]:
    doctor_checks.take_stock(config, files)
    yield ok("files", f"{files.found} found")
