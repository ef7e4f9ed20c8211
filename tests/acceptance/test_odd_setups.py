"""Set-ups that lead nowhere, or further than they should: each is named with its cure before harm is done."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from aiosmtpd.controller import Controller
from aiosmtpd.smtp import AuthResult, LoginPassword

from acceptance.support import (
    GLIDERWATCH,
    PATIENCE,
    TRACEBACK,
    Daemon,
    Mailbox,
    Site,
    command,
    lines,
    mail_server,
    until,
)
from gliderwatch.simulate.delivery import write_mission
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Scenario

ROOT = Path(__file__).resolve().parents[2]

DAY = 86400.0
SECRET = "Pässwort €5"


@pytest.fixture
def site(tmp_path: Path) -> Site:
    made = Site(tmp_path)
    made.folder("angus")
    return made


def with_settings(site: Site, **sections: Any) -> Path:
    """The configuration of the site with other sections."""
    site.configure("angus")
    document = json.loads(site.config.read_text(encoding="utf-8"))
    site.config.write_text(json.dumps(document | sections, indent=1), encoding="utf-8")
    return site.config


# --------------------------------------------------------------------------- what a service left


@pytest.fixture(scope="module")
def watched(tmp_path_factory: pytest.TempPathFactory) -> Site:
    """What a service watched that has ended: angus, and two gliders of which a folder is a link."""
    folder = tmp_path_factory.mktemp("watched")
    made = Site(folder)
    made.folder("angus")
    for link in ("bruce", "clyde/from-glider"):
        real = folder / "elsewhere" / link.partition("/")[0] / "from-glider"
        real.mkdir(parents=True)
        (made.root / link).parent.mkdir(exist_ok=True)
        (made.root / link).symlink_to(real if "/" in link else real.parent)
    made.configure("angus", "bruce", "clyde")
    with Daemon(made):
        until(made.state.exists, "a state file")
    return made


@pytest.mark.parametrize("name", ["check", "doctor", "status"])
def test_a_folder_that_is_a_link_is_named_with_its_cure(watched: Site, name: str) -> None:
    shown = "".join(command(name, "-c", watched.config, COLUMNS="200").stdout.split())
    assert shown.count("isasymboliclink,andlinksarenotfollowed") == 2, shown
    for glider in ("bruce", "clyde"):
        real = watched.config.parent / "elsewhere" / glider / "from-glider"
        assert f"paths:[{real}]" in shown, shown


def test_a_copy_of_the_state_does_not_go_into_a_dockserver(watched: Site) -> None:
    target = watched.folder("angus") / "copy.sqlite"
    refused = command("backup", "-c", watched.config, target)
    assert refused.returncode == 2 and "root" in refused.stderr and TRACEBACK not in refused.stderr
    assert not target.exists()


# --------------------------------------------------------------------------- channels


def test_a_password_with_letters_beyond_ascii(site: Site) -> None:
    def check(_server: Any, _session: Any, _envelope: Any, _mechanism: str, data: Any) -> AuthResult:
        right = isinstance(data, LoginPassword) and data.password == SECRET.encode()
        return AuthResult(success=right, handled=False)

    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    box = Mailbox()
    post = Controller(
        box, hostname="127.0.0.1", port=port, auth_require_tls=False, authenticator=check, auth_required=True
    )
    post.start()
    try:
        url = f"mailto://watch:${{SECRET}}@127.0.0.1:{port}?from=a@ship.local&to=b@ship.local"
        sent = command("test-alert", "-c", site.configure("angus", url=url), SECRET=SECRET)
    finally:
        post.stop()
    assert (sent.returncode, sent.stdout, len(box.mails)) == (0, "mail: accepted\n", 1), sent


def test_a_mail_channel_that_names_nobody_is_refused(site: Site) -> None:
    with mail_server() as box:
        config = site.configure("angus", url=f"mailto://localhost:{box.port}")
        checked, sent = command("check", "-c", config), command("test-alert", "-c", config)
        assert box.mails == []
    assert checked.returncode == 1 and "channels.mail.url" in checked.stdout and "to=" in checked.stdout
    assert sent.returncode == 1 and "accepted" not in sent.stdout and "to=" in sent.stdout + sent.stderr


def test_a_secret_without_an_end_or_a_writer_is_refused_at_once(site: Site, tmp_path: Path) -> None:
    fifo = tmp_path / "fifo"
    os.mkfifo(fifo)
    url = "mailto://watch:${file:%s}@127.0.0.1:9?from=a@ship.local&to=b@ship.local"
    document = {name: {"url": url % source} for name, source in (("a", "/dev/zero"), ("b", fifo))}
    config = with_settings(site, channels=document)
    limited = ["/bin/sh", "-c", 'ulimit -v 2000000; exec "$@"', "sh", GLIDERWATCH, "check", "-c", config]
    checked = subprocess.run(limited, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert checked.returncode == 1, checked
    for source in ("/dev/zero", fifo):
        assert f"file {source} is no regular file: put the secret into one" in checked.stdout


def test_a_bad_name_is_shown_and_a_secret_is_not(site: Site) -> None:
    config = with_settings(site, gliders={"the blue one!": None})
    checked = command("check", "-c", config)
    assert checked.returncode == 2 and "the blue one!" in checked.stdout + checked.stderr


# --------------------------------------------------------------------------- doctor's cure

AS_NOBODY = """
import encodings.ascii, encodings.idna, os, pkgutil, sys
import gliderwatch, gliderwatch.cli.main
for each in pkgutil.walk_packages(gliderwatch.__path__, "gliderwatch."):
    try:
        __import__(each.name)
    except ImportError:  # an extra that is not installed
        pass
os.setgroups([]), os.setgid(65534), os.setuid(65534)
gliderwatch.cli.main.main(["doctor", "-c", sys.argv[1]])
"""


@pytest.mark.skipif(os.getuid() != 0, reason="only root can close a folder to somebody else")
def test_the_cure_of_a_closed_cache_is_no_privilege() -> None:
    with tempfile.TemporaryDirectory() as folder:  # those of pytest are closed to others
        Path(folder).chmod(0o755)
        site = Site(Path(folder))
        config = site.configure("angus")
        config.chmod(0o644)
        site.root.chmod(0o755)
        site.cache.chmod(0o700)
        for part in (
            "src",
            "config",
        ):  # a checkout below /root is closed to others, and presets are read late
            shutil.copytree(ROOT / part, Path(folder) / part)
        words = [GLIDERWATCH.with_name("python"), "-c", AS_NOBODY, config]
        env = os.environ | {"COLUMNS": "200", "PYTHONPATH": str(Path(folder) / "src")}
        found = subprocess.run(words, env=env, capture_output=True, text=True, check=False)
    text = "".join(found.stdout.split())
    assert f"{site.cache}(root:root,mode0700)isclosedtonobody" in text, found.stdout
    assert f"setfacl-R-mu:nobody:rX{site.cache}" in text and "usermod" not in text
    assert "Error" not in text and TRACEBACK not in found.stderr


# --------------------------------------------------------------------------- all gliders late


def test_all_gliders_late_is_one_message_for_the_shore_side(tmp_path: Path) -> None:
    """Nothing came of four for fourteen hours: one message of each kind, where there were four."""
    silent = Scenario().start + 0.6 * DAY
    names = ("angus", "bruce", "clyde", "dora")
    for seed, name in enumerate(names):
        mission = simulate(Scenario(seed=seed + 20, glider=name, days=1.6))
        kept = [s for s in mission.segments if not silent < s.closed < silent + 14 * 3600.0]
        write_mission(tmp_path / "gliders", tmp_path / "cache", replace(mission, segments=tuple(kept)))
    assert command("run", "--replay", tmp_path, "--out", tmp_path / "out").returncode == 0
    said = lines(tmp_path / "out" / "alerts.jsonl")
    assert [each["kind"] for each in said] == ["overdue", "reminder", "all_clear"], said
    assert all(name in said[0]["body"] for name in names) and "shore" in said[0]["body"]
