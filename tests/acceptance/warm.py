"""Commands in processes of their own that need not import the package again.

To start Python and import gliderwatch is nearly all that a command costs. A server that has imported it forks
for each: own arguments, environment, folder and outputs, one exit code. `support.installed` starts the
program itself, as `support.Daemon` does; `test_commands` compares the two.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from subprocess import CompletedProcess, TimeoutExpired

CONTEXT = multiprocessing.get_context("forkserver")
CONTEXT.set_forkserver_preload(
    [
        "gliderwatch.cli.main",
        "gliderwatch.cli.doctor",
        "gliderwatch.service.daemon",
        "gliderwatch.service.replay",
    ]
)


def _main(arguments: Sequence[str], env: Mapping[str, str], cwd: Path, outputs: Sequence[Path]) -> None:
    """What the installed script does, in the process that was forked for it."""
    os.environ.clear()
    os.environ.update(env)
    time.tzset()
    tempfile.tempdir = None
    os.chdir(cwd)
    for number, path in enumerate(outputs, 1):
        target = os.open(path, os.O_WRONLY)
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
        process = CONTEXT.Process(target=_main, args=(arguments, dict(env), cwd, outputs))
        process.start()
        process.join(timeout)
        if process.exitcode is None:
            process.kill()
            process.join()
            raise TimeoutExpired(list(arguments), timeout)
        out, err = (path.read_text(encoding="utf-8") for path in outputs)
        return CompletedProcess(list(arguments), process.exitcode, out, err)
