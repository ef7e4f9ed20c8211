"""What acceptance tests share: a dockserver of their own, the installed command, a mail server."""

from __future__ import annotations

import email
import email.policy
import hashlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from aiosmtpd.controller import Controller

from acceptance import warm
from gliderwatch.model import Assessment, Incident
from gliderwatch.simulate.delivery import deliver, write_cache
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Fault, FaultKind, Mission, Scenario
from gliderwatch.store.state_file import File, Status, Store

_OWN = Path(sys.executable).with_name("gliderwatch")
GLIDERWATCH = Path(os.environ.get("GLIDERWATCH_COMMAND", _OWN))
"""The installed command; of another release where the environment names one: what was mended fails there."""
PATIENCE = 60.0
PASSWORD = "hunter2-do-not-tell"
TRACEBACK = "Traceback"
UNBORN = re.compile(
    TRACEBACK
    + r""" \(most recent call last\):
  File "<string>", line 1, in <module>
(  File "[^"]*/multiprocessing/spawn\.py", line \d+, in (spawn_main|_main)
(    .*\n)+)+EOFError: Ran out of input
"""
)


def until(condition: Callable[[], object], what: str, patience: float = PATIENCE) -> None:
    """Wait until a condition holds; fail with `what` when it does not in time."""
    deadline = time.monotonic() + patience
    begun = time.monotonic()
    while not condition():
        now = time.monotonic()
        assert now < deadline, f"not within {patience:g} s: {what}"
        time.sleep(max(0.02, now - begun))  # to look takes at most half of a core from what is waited for
        begun = time.monotonic()


def command(
    *arguments: object, cwd: Path | None = None, timeout: float = 120.0, **env: str
) -> subprocess.CompletedProcess[str]:
    """Run a command in a process of its own that is ready for it, and wait for its end."""
    if GLIDERWATCH != _OWN:
        return installed(*arguments, cwd=cwd, timeout=timeout, **env)
    words = [str(GLIDERWATCH), *map(str, arguments)]
    return warm.run(words, os.environ | env, cwd or Path.cwd(), timeout)


def installed(
    *arguments: object, cwd: Path | None = None, timeout: float = 120.0, **env: str
) -> subprocess.CompletedProcess[str]:
    """The same by the installed program, from the start of Python on."""
    return subprocess.run(
        [str(GLIDERWATCH), *map(str, arguments)],
        cwd=cwd,
        env=os.environ | env,
        capture_output=True,
        text=True,
        check=False,
        timeout=timeout,
    )


def lines(path: Path) -> list[dict[str, Any]]:
    """The objects of a file of JSON lines."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


# --------------------------------------------------------------------------- missions


@cache
def remora(days: float = 3.0, *, onset: float = 1.5, seed: int = 4, glider: str = "bruce") -> Mission:
    """A mission on which a remora takes hold of the glider: it has an incident."""
    start = Scenario().start
    fault = Fault(FaultKind.REMORA, start + onset * 86400, 8.0)
    return simulate(Scenario(seed=seed, glider=glider, days=days, faults=(fault,)))


@cache
def healthy(days: float = 1.0, *, seed: int = 11, glider: str = "angus") -> Mission:
    """A mission without a fault."""
    return simulate(Scenario(seed=seed, glider=glider, days=days))


# --------------------------------------------------------------------------- mail


@dataclass(frozen=True, slots=True)
class Mail:
    """A mail as the server took it; ``accepted`` by the monotonic clock (s)."""

    id: str
    subject: str
    text: str
    accepted: float


@dataclass  # no slots: those of Python 3.11.2, which is Debian 12's, are not to be looked at as aiosmtpd does
class Mailbox:
    """The handler of a mail server: keeps what it accepts. While ``refusing``, it accepts nothing."""

    mails: list[Mail] = field(default_factory=list)
    port: int = 0
    refusing: bool = False

    @property
    def url(self) -> str:
        """The channel that leads here."""
        return f"mailto://127.0.0.1:{self.port}?from=gliderwatch@dockserver.local&to=pilot@ship.local"

    def times(self) -> Counter[str]:
        """How often each Message-ID arrived."""
        return Counter(mail.id for mail in self.mails)

    async def handle_DATA(self, _server: Any, _session: Any, envelope: Any) -> str:  # noqa: N802 (aiosmtpd)
        """Take one mail."""
        if self.refusing:
            return "451 come back later"
        mail = email.message_from_bytes(envelope.content, policy=email.policy.default)
        body = mail.get_body(("plain",))
        text = "" if body is None else body.get_content()
        self.mails.append(Mail(mail["Message-ID"], mail["Subject"], text, time.monotonic()))
        return "250 accepted"


@contextmanager
def mail_server(box: Mailbox | None = None) -> Iterator[Mailbox]:
    """A mail server on a port of its own; one that was stopped comes back on the port it had."""
    box = box if box is not None else Mailbox()
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind(("127.0.0.1", box.port))
        box.port = probe.getsockname()[1]
    server = Controller(box, hostname="127.0.0.1", port=box.port)
    server.start()
    try:
        yield box
    finally:
        server.stop()


# --------------------------------------------------------------------------- dockserver


class Site:
    """A dockserver, a configuration and a state file, below one folder."""

    def __init__(self, folder: Path) -> None:
        self.root, self.cache = folder / "gliders", folder / "cache"
        self.state, self.config = folder / "state" / "state.sqlite", folder / "gliderwatch.yml"
        self.root.mkdir(parents=True)
        self.cache.mkdir()

    def configure(
        self,
        *gliders: str,
        url: str | None = None,
        surfacing: Sequence[str] = (),
        defaults: Mapping[str, Any] | None = None,
        **dockserver: object,
    ) -> Path:
        """Write the configuration (JSON is YAML); files of short names settle in a second."""
        places = {"roots": [str(self.root)], "cache": [str(self.cache)], "settle_seconds": 1}
        document: dict[str, Any] = {
            "dockserver": places | dockserver,
            "state": {"path": str(self.state)},
            "defaults": defaults or {"normal_speed": {"min": 0.2, "max": 0.4}},
            "gliders": dict.fromkeys(gliders),
        }
        if url is not None:
            document["channels"] = {"mail": {"url": url}}
            document["recipients"] = {"pilot": {"channels": ["mail"], "surfacing": list(surfacing)}}
        self.config.write_text(json.dumps(document, indent=1), encoding="utf-8")
        return self.config

    def folder(self, glider: str) -> Path:
        """The from-glider folder of a glider, made if need be."""
        folder = self.root / glider / "from-glider"
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    def caches(self, *missions: Mission) -> None:
        """Put the cache files of missions where they belong."""
        for mission in missions:
            write_cache(self.cache, mission)

    def put(self, glider: str, name: str, data: bytes) -> Path:
        """Let a file arrive as a dockserver does."""
        path = self.folder(glider) / name
        deliver(path, data)
        return path

    def files(self) -> dict[str, File]:
        """The ledger by the names of files; empty before there is one."""
        if not self.state.exists():
            return {}
        store = Store.reading(self.state)
        try:
            return {Path(file.path).name: file for file in store.files(*Status)}
        finally:
            store.close()

    def statuses(self, *names: str) -> list[Status | None]:
        """What became of files by name; None of one not seen yet."""
        ledger = self.files()
        return [ledger[name].status if name in ledger else None for name in names]

    def undelivered(self) -> int:
        """How many messages wait in the outbox."""
        store = Store.reading(self.state)
        try:
            return len(store.undelivered())
        finally:
            store.close()

    def tree(self) -> dict[str, tuple[int, str]]:
        """Everything below the root: time of change, and content or what it is instead."""
        return {str(p.relative_to(self.root)): _print(p) for p in sorted(self.root.rglob("*"))}

    def status(self) -> dict[str, Any]:
        """What `status --json` tells."""
        result = command("status", "-c", self.config, "--json")
        assert result.stdout, result.stderr
        told: dict[str, Any] = json.loads(result.stdout)
        return told


def _print(path: Path) -> tuple[int, str]:
    state = path.lstat()
    content = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else f"mode {state.st_mode:o}"
    return state.st_mtime_ns, content


def results(state: Path) -> dict[str, tuple[list[Assessment], list[Incident]]]:
    """Assessments and incidents of each glider in a state file."""
    store = Store.reading(state)
    try:
        return {glider: (store.assessments(glider), store.incidents(glider)) for glider in store.gliders()}
    finally:
        store.close()


# --------------------------------------------------------------------------- daemon

_FLIGHT_DATA = re.compile(r"/from-glider/[^/\s]+\.[smd][bc]d\b")


def lacks_key(entry: Mapping[str, Any], gliders: Iterable[str]) -> str | None:
    """The key that a line of the log lacks, by which one would look for it; None: it has all."""
    about = str(entry.get("alert", "")).partition("/")[0]
    wanted = {
        "path": entry["event"].startswith("file ") or _FLIGHT_DATA.search(str(entry.get("reason", ""))),
        "glider": entry["event"].startswith("file ") or about in gliders,
        "alert": entry["event"].startswith("alert"),
        "channel": entry["event"].startswith("alert "),
    }
    return next((key for key, is_wanted in wanted.items() if is_wanted and key not in entry), None)


class Daemon:
    """The service as a process. Its log goes to a file, which lives on from start to start.

    A `program` is started as it is, and so is the installed one where the environment has modules for it.
    """

    def __init__(self, site: Site, program: Sequence[object] = (), **env: str) -> None:
        self.site, self.env = site, env
        self.is_warm = not program and GLIDERWATCH == _OWN and "PYTHONPATH" not in env
        self.program = [str(part) for part in program or (GLIDERWATCH,)]
        self.log_path = site.config.with_name("daemon.log")
        self.scratch = site.config.with_name("scratch")
        self.scratch.mkdir(exist_ok=True)
        self.process: subprocess.Popen[bytes] | warm.Service | None = None
        self._begun = 0

    def __enter__(self) -> Daemon:
        return self.start().ready()

    def __exit__(self, kind: type[BaseException] | None = None, *_: object) -> None:
        if self.process is not None:
            self.process.kill()
            self.process.wait()
        if kind is None:
            gliders = {folder.name for folder in self.site.root.glob("*")}
            assert [e for e in self.log(".*") if lacks_key(e, gliders)] == []

    def start(self) -> Daemon:
        """Start it; `ready` waits until it watches."""
        words = [*self.program, "run", "-c", str(self.site.config)]
        env = os.environ | {"TMPDIR": str(self.scratch)} | self.env
        with self.log_path.open("ab") as log:
            self._begun = log.tell()
            if self.is_warm:
                self.process = warm.Service(words, env, self.log_path)
            else:
                self.process = subprocess.Popen(words, env=env, stderr=log, stdout=log)
        return self

    @property
    def pid(self) -> int:
        """Its process id."""
        assert self.process is not None
        return self.process.pid

    def ready(self) -> Daemon:
        """Wait until it watches."""

        def watches() -> bool:
            assert self.alive(), f"it ended: {self.text()}"
            return self.watches()

        until(watches, "watching")
        return self

    def watches(self) -> bool:
        """Whether it has said since its start that it watches."""
        with self.log_path.open("rb") as log:
            log.seek(self._begun)
            return f'"pid": {self.pid},'.encode() in log.read()

    def text(self) -> str:
        """All that it ever said; without what Python itself says of a process that it was starting for a
        daemon that was killed just then: nothing of gliderwatch is loaded in it yet."""
        return UNBORN.sub("", self.log_path.read_text(encoding="utf-8") if self.log_path.exists() else "")

    def log(self, event: str) -> list[dict[str, Any]]:
        """Lines of its log with an event, a pattern."""
        whole = self.text().rpartition("\n")[0].splitlines()
        entries = (json.loads(line) for line in whole if line.startswith("{"))
        return [entry for entry in entries if re.fullmatch(event, entry["event"])]

    @contextmanager
    def stopped(self) -> Iterator[None]:
        """Meanwhile none of its threads runs: they stop only a while after the signal was sent."""
        process = self.process
        assert process is not None
        threads = Path(f"/proc/{process.pid}/task")

        def stopped() -> bool:  # or dead
            stats = [stat.read_text() for stat in threads.glob("*/stat")]
            return all(stat.rpartition(")")[2].split()[0] in "TZX" for stat in stats)

        process.send_signal(signal.SIGSTOP)
        try:
            with suppress(OSError):
                until(stopped, "stopped")
            yield
        finally:
            process.send_signal(signal.SIGCONT)

    def kill(self) -> None:
        """End it as a power cut would."""
        assert self.process is not None
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()

    def stop(self, patience: float = PATIENCE) -> int:
        """End it by SIGTERM; its exit code."""
        assert self.process is not None
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(patience)

    def reload(self) -> None:
        """Send SIGHUP."""
        assert self.process is not None
        self.process.send_signal(signal.SIGHUP)

    def alive(self) -> bool:
        """Whether the process runs."""
        return self.process is not None and self.process.poll() is None

    def wait(self, patience: float = PATIENCE) -> int:
        """Wait for its end; its exit code."""
        assert self.process is not None
        return self.process.wait(patience)


@contextmanager
def notify_socket(folder: Path) -> Iterator[tuple[str, list[str]]]:
    """A socket as the service manager has one: its address, and the lines that come in."""
    address, told = str(folder / "notify"), []
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sock:
        sock.bind(address)
        thread = threading.Thread(target=_listen, args=(sock, told), daemon=True)
        thread.start()
        yield address, told
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as end:
            end.sendto(b"", address)
        thread.join(PATIENCE)


def _listen(sock: socket.socket, told: list[str]) -> None:
    while data := sock.recv(4096):
        told += data.decode().splitlines()
