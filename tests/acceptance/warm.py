"""Commands in processes of their own that need not import the package again.

To start Python and import gliderwatch is nearly all that a command costs. A server that has imported it forks
for each: own arguments, environment, folder and outputs, one exit code. So it is with the service of most
tests. `support.installed` starts the program itself, as `support.Daemon` does with a `program`;
`test_commands` compares the two.
"""

from __future__ import annotations

import gc
import multiprocessing
import multiprocessing.forkserver
import os
import signal
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from subprocess import CompletedProcess, TimeoutExpired

CONTEXT = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload(["acceptance.preload"])


@cache
def _start_server() -> None:
    """Start the server, once: on 3.11 it looks for what it loads where Python does, not where pytest does."""
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = str(Path(__file__).parents[1])
    try:
        multiprocessing.forkserver.ensure_running()
    finally:
        if before is None:
            del os.environ["PYTHONPATH"]
        else:
            os.environ["PYTHONPATH"] = before


def _main(arguments: Sequence[str], env: Mapping[str, str], cwd: Path, outputs: Sequence[Path]) -> None:
    """What the installed script does, in the process that was forked for it."""
    os.environ.clear()
    os.environ.update(env)
    time.tzset()
    tempfile.tempdir = None
    os.chdir(cwd)
    for number, path in enumerate(outputs, 1):
        target = os.open(path, os.O_WRONLY | os.O_APPEND)
        os.dup2(target, number)
        os.close(target)
    sys.argv = list(arguments)
    from gliderwatch.cli.main import main

    code: object = None
    try:
        main()
    except SystemExit as end:
        code = end.code
    gc.collect()  # as when Python ends: what was left open is closed
    sys.exit(code)


def run(arguments: Sequence[str], env: Mapping[str, str], cwd: Path, timeout: float) -> CompletedProcess[str]:
    """As `subprocess.run` with captured text. Raises TimeoutExpired after `timeout` (s)."""
    with tempfile.TemporaryDirectory() as folder:
        outputs = [Path(folder, name) for name in ("stdout", "stderr")]
        for path in outputs:
            path.touch()
        _start_server()
        process = CONTEXT.Process(target=_main, args=(arguments, dict(env), cwd, outputs))
        process.start()
        process.join(timeout)
        if process.exitcode is None:
            process.kill()
            process.join()
            raise TimeoutExpired(list(arguments), timeout)
        out, err = (path.read_text(encoding="utf-8") for path in outputs)
        return CompletedProcess(list(arguments), process.exitcode, out, err)


class Service:
    """A command that runs on, with what tests use of `subprocess.Popen`. What it says is added to a file."""

    def __init__(self, arguments: Sequence[str], env: Mapping[str, str], log: Path) -> None:
        _start_server()
        self._process = CONTEXT.Process(target=_main, args=(arguments, dict(env), Path.cwd(), [log, log]))
        self._process.start()

    @property
    def pid(self) -> int:
        """Its process id."""
        assert self._process.pid is not None
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        """Its exit code, or the signal that ended it as a negative number; None while it runs."""
        return self._process.exitcode

    def poll(self) -> int | None:
        """The same."""
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Send a signal, if it runs."""
        if self.returncode is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it as a power cut would."""
        self.send_signal(signal.SIGKILL)

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end; its exit code. Raises TimeoutExpired after `timeout` (s)."""
        self._process.join(timeout)
        if self.returncode is None:
            raise TimeoutExpired("the service", timeout or 0.0)
        return self.returncode
