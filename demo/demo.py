"""The main job in a minute: gliders surface, a remora takes hold of one, the pilot's mail arrives.

Everything is real but the sea: the files are genuine Dinkum files, the daemon is the installed command,
the mail goes through an SMTP server on this machine. Run by `make demo`; leaves nothing behind.
"""

from __future__ import annotations

import email.policy
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from email.message import Message
from pathlib import Path
from typing import Any

from aiosmtpd.controller import Controller
from rich.console import Console
from rich.panel import Panel
from rich.text import Text

from gliderwatch.simulate.dockserver import Arrival, arrivals, deliver, from_glider, write_cache
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Fault, FaultKind, Mission, Scenario

DAYS, ONSET = 3.0, 2.0
PACE = 0.2
"""Seconds between two files: three and a half hours of a glider's life."""
PATIENCE = 30.0
GLIDERWATCH = Path(sys.executable).with_name("gliderwatch")

CONFIGURATION = """\
dockserver:
  roots: [{folder}/gliders]
  cache: [{folder}/cache]
state: {{path: {folder}/state.sqlite}}
defaults:
  normal_speed: {{min: 0.20, max: 0.40}}
gliders: {{angus: , bruce: }}
channels:
  mail: {{url: "mailto://127.0.0.1:{port}?from=gliderwatch@dockserver.local&to=pilot@ship.local"}}
recipients:
  pilot: {{channels: [mail]}}
"""


class Mailbox:
    """The local mail server: keeps what it gets, and shows it at once."""

    def __init__(self, console: Console) -> None:
        self.mails: list[Message] = []
        self._console = console

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


def fleet() -> list[Mission]:
    """Two gliders; a remora takes hold of one of them after two days."""
    healthy = Scenario(seed=11, glider="angus", days=DAYS)
    remora = Fault(FaultKind.REMORA, healthy.start + ONSET * 86400, 8.0)
    slowed = Scenario(seed=4, glider="bruce", days=DAYS, faults=(remora,))
    return [simulate(healthy), simulate(slowed)]


def play(missions: list[Mission], root: Path, console: Console) -> None:
    """Let the files of all gliders arrive in the order of time."""
    files: list[tuple[Arrival, Mission]] = [(a, m) for m in missions for a in arrivals(m)]
    told = False
    for arrival, mission in sorted(files, key=lambda f: f[0].time):
        if not told and arrival.time >= mission.scenario.start + ONSET * 86400:
            console.print("[bold yellow]        a remora takes hold of bruce[/]")
            told = True
        when = time.strftime("%d %b %H:%M", time.gmtime(arrival.time))
        console.print(f"{when}  {mission.scenario.glider} surfaced: {arrival.name}", highlight=False)
        deliver(from_glider(root, mission) / arrival.name, arrival.data)
        time.sleep(PACE)


def wait_for_status(config: Path) -> None:
    """Until the daemon gives a sign of life."""
    deadline = time.monotonic() + PATIENCE
    while subprocess.run([GLIDERWATCH, "status", "-c", config], check=False, capture_output=True).returncode:
        if time.monotonic() > deadline:
            sys.exit("the daemon does not start: see what it said above")
        time.sleep(0.2)


def main() -> int:
    """Run the demo; 0 when the alert arrived."""
    console = Console(width=100)
    mailbox = Mailbox(console)
    port = free_port()
    server = Controller(mailbox, hostname="127.0.0.1", port=port)
    server.start()
    with tempfile.TemporaryDirectory(prefix="gliderwatch-demo-") as name:
        folder = Path(name)
        config = folder / "gliderwatch.yml"
        config.write_text(CONFIGURATION.format(folder=folder, port=port))
        missions = fleet()
        for mission in missions:
            write_cache(folder / "cache", mission)
            from_glider(folder / "gliders", mission).mkdir(parents=True)
        console.rule("a dockserver, two gliders, one daemon")
        subprocess.run([GLIDERWATCH, "check", "-c", config], check=True)
        with (folder / "daemon.log").open("wb") as log:
            environment = dict(os.environ, PYTHONUNBUFFERED="1")
            daemon = subprocess.Popen([GLIDERWATCH, "run", "-c", config], stderr=log, env=environment)
        try:
            wait_for_status(config)
            play(missions, folder / "gliders", console)
            deadline = time.monotonic() + PATIENCE
            while not mailbox.mails and time.monotonic() < deadline:
                time.sleep(0.1)
            console.rule("gliderwatch status")
            subprocess.run([GLIDERWATCH, "status", "-c", config], check=False)
        finally:
            daemon.send_signal(signal.SIGTERM)
            daemon.wait(10)
            server.stop()
    arrived = [m["Subject"] for m in mailbox.mails if "bruce" in m["Subject"]]
    false = [m["Subject"] for m in mailbox.mails if "angus" in m["Subject"]]
    console.rule(f"{len(arrived)} mails about bruce, {len(false)} about angus, who is well")
    return 0 if arrived and not false else 1


if __name__ == "__main__":
    sys.exit(main())
