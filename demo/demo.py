"""The main job in a minute: gliders surface, a remora takes hold of one, another aborts; the mails arrive.

Everything is real but the sea: the files are genuine Dinkum files, the daemon is the installed command,
the mail goes through an SMTP server on this machine. Run by `make demo`; leaves its pages, and shows them
where there is a display.
"""

from __future__ import annotations

import email.policy
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import webbrowser
from email.message import Message
from pathlib import Path
from typing import Any

from aiosmtpd.controller import Controller
from rich.console import Console
from rich.panel import Panel
from rich.text import Text

from gliderwatch.simulate.calls import CallRates, Fate, call_logs
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario

HURT, WELL, ABORTING = "sim-01", "sim-02", "sim-03"
SPEEDUP = 12000
"""Three days of the gliders' lives in about twenty seconds."""
FLEET = ("--gliders", "2", "--days", "3", "--fault", "remora:8@2", "--seed", "4")
PATIENCE = 30.0
DAY, DIVE = 86400.0, 3 * 3600.0
LINE = 0.05
"""Seconds from line to line of a log."""
GLIDERWATCH = Path(sys.executable).with_name("gliderwatch")

CONFIGURATION = """\
dockserver:
  roots: [{folder}/dockserver/gliders]
  cache: [{folder}/dockserver/cache]
state: {{path: {folder}/state.sqlite}}
defaults:
  normal_speed: {{min: 0.20, max: 0.40}}
  overdue_hours: 96  # three days pass in seconds
gliders: {{sim-01: , sim-02: , sim-03: }}
channels:
  mail: {{url: "mailto://127.0.0.1:{port}?from=gliderwatch@dockserver.local&to=pilot@ship.local"}}
recipients:
  pilot: {{channels: [mail]}}
pages: {{folder: {pages}}}
"""
PAGES = Path("build/demo-pages")
"""What is left of the demo: its pages."""


class Mailbox:
    """The local mail server: keeps what it gets, and shows it at once."""

    def __init__(self, console: Console) -> None:
        self.mails: list[Message] = []
        self._console = console

    def gliders(self) -> set[str]:
        """The gliders that mails are about."""
        return {name for name in (HURT, WELL, ABORTING) if any(name in m["Subject"] for m in self.mails)}

    async def handle_DATA(  # noqa: N802 (aiosmtpd wants this name)
        self, _server: Any, _session: Any, envelope: Any
    ) -> str:
        """Take one mail."""
        mail = email.message_from_bytes(envelope.content, policy=email.policy.default)
        self.mails.append(mail)
        body = mail.get_body(("plain",)).get_content()
        title = Text(f"mail for {mail['To']}: {mail['Subject']}", style="bold red")
        self._console.print(Panel(Text(body.strip()), title=title, border_style="red", title_align="left"))
        return "250 accepted"


def free_port() -> int:
    """A port that nobody uses."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def play(dockserver: Path, console: Console) -> None:
    """Let a simulated fleet send its files as time passes, and show them as they come."""
    # The dive in which the third day ends takes some three hours more: no file is of a time to come.
    began = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(time.time() - 3 * DAY - DIVE))
    scenario = dockserver / "scenario.yml"
    scenario.write_text(f"about: A demo.\nstart: {began}\nsurface_segments: true\n")
    command = [GLIDERWATCH, "simulate", dockserver, "--scenario", scenario, *FLEET]
    command += ["--live", "--speedup", str(SPEEDUP)]
    fleet = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    seen: set[Path] = set()
    told = False
    try:
        while fleet.poll() is None:
            time.sleep(0.1)
            for path in sorted(set(dockserver.glob("gliders/*/from-glider/*.sbd")) - seen):
                seen.add(path)
                when = path.stat().st_mtime
                if not told and when > onset(dockserver):
                    console.print(f"[bold yellow]              a remora has taken hold of {HURT}[/]")
                    told = True
                day = time.strftime("%d %b %H:%M", time.gmtime(when))
                console.print(f"{day}  {path.parts[-3]} sent {path.name}", highlight=False)
    finally:
        fleet.terminate()
        ended = fleet.wait()
    if ended not in (0, -signal.SIGTERM):
        sys.exit("the simulation failed: try it with `gliderwatch simulate`")


def call(dockserver: Path, console: Console) -> None:
    """Let a third glider abort: the log of its call grows, as that of a call that is on now."""
    scenario = Scenario(glider=ABORTING, seed=4, days=1.0, start=time.time() - DAY)
    logs = call_logs(simulate(scenario), CallRates(abort=0.5))
    log = next(log for log in logs if log.fate is Fate.ABORT)
    path = dockserver / "gliders" / ABORTING / "logs" / log.name
    path.parent.mkdir(parents=True)
    console.print(f"{ABORTING} calls: {path.name} grows", highlight=False)
    for _, line in log.lines:
        with path.open("ab") as file:
            file.write(line)
        time.sleep(LINE)


def onset(dockserver: Path) -> float:
    """When the remora comes (s), as the truth beside the files tells."""
    truth = json.loads((dockserver / "truth.json").read_text(encoding="utf-8"))
    return float(truth["gliders"][0]["faults"][0]["onset_seconds"])


def gliderwatch(*words: str | Path, quiet: bool = False) -> int:
    """Run the installed command, which Ctrl-C here does not reach; its exit code."""
    out = subprocess.DEVNULL if quiet else None
    return subprocess.run(
        [GLIDERWATCH, *words], check=False, stdout=out, stderr=out, start_new_session=True
    ).returncode


def wait_for_status(config: Path) -> None:
    """Until the daemon gives a sign of life."""
    deadline = time.monotonic() + PATIENCE
    while gliderwatch("status", "-c", config, quiet=True):
        if time.monotonic() > deadline:
            sys.exit("the daemon does not start: see what it said above")
        time.sleep(0.2)


def show(console: Console) -> None:
    """Say where the pages lie, and show them where there is a display."""
    page = (PAGES / "index.html").absolute()
    console.print(f"its page, with one a glider: {page}", soft_wrap=True, highlight=False)
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        webbrowser.open(page.as_uri())


def main() -> int:
    """Run the demo; 0 when the alert arrived."""
    console = Console(width=80)
    mailbox = Mailbox(console)
    port = free_port()
    server = Controller(mailbox, hostname="127.0.0.1", port=port)
    server.start()
    with tempfile.TemporaryDirectory(prefix="gliderwatch-demo-") as name:
        folder = Path(name)
        config = folder / "gliderwatch.yml"
        config.write_text(CONFIGURATION.format(folder=folder, port=port, pages=PAGES.absolute()))
        for part in ("gliders", "cache"):
            (folder / "dockserver" / part).mkdir(parents=True)
        shutil.rmtree(PAGES, ignore_errors=True)
        console.rule("a dockserver, three gliders, one daemon")
        if gliderwatch("check", "-c", config):
            return 1
        with (folder / "daemon.log").open("wb") as log:
            environment = dict(os.environ, PYTHONUNBUFFERED="1")
            daemon = subprocess.Popen(
                [GLIDERWATCH, "run", "-c", config], stderr=log, env=environment, start_new_session=True
            )
        try:
            wait_for_status(config)
            play(folder / "dockserver", console)
            call(folder / "dockserver", console)
            deadline = time.monotonic() + PATIENCE
            while {HURT, ABORTING} - mailbox.gliders() and time.monotonic() < deadline:
                time.sleep(0.1)
            console.rule("gliderwatch status")
            gliderwatch("status", "-c", config)
            gliderwatch("pages", "-c", config, quiet=True)  # all as of now, whatever waits to be written
        finally:
            daemon.send_signal(signal.SIGTERM)
            daemon.wait(10)
            server.stop()
    arrived = [m["Subject"] for m in mailbox.mails if HURT in m["Subject"]]
    false = [m["Subject"] for m in mailbox.mails if WELL in m["Subject"]]
    aborted = [m["Subject"] for m in mailbox.mails if m["Subject"] == f"{ABORTING} ABORTED: leak"]
    console.rule(
        f"mails about {HURT}: {len(arrived)}; about {WELL}, which is well: {len(false)}; "
        f"about the abort of {ABORTING}: {len(aborted)}"
    )
    show(console)
    return 0 if arrived and not false and len(aborted) == 1 else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:  # Ctrl-C; what was started has been stopped by then
        print("stopped", file=sys.stderr)
        sys.exit(130)
