"""Who is second hears of what nobody acknowledges, over a kill, and of nothing else."""

from __future__ import annotations

import json
from pathlib import Path

from acceptance.support import TRACEBACK, Daemon, Site, command, mail_server, remora, until
from gliderwatch.simulate.delivery import arrivals

GLIDERS = ("bruce", "lena")


def test_what_nobody_acknowledges_reaches_the_chief(tmp_path: Path) -> None:
    site = Site(tmp_path)
    missions = [remora(2.2, onset=1.2, glider=glider) for glider in GLIDERS]
    site.caches(*missions)
    with mail_server() as pilot, mail_server() as chief:
        site.configure(*GLIDERS)
        document = json.loads(site.config.read_text(encoding="utf-8"))
        document["channels"] = {"mail": {"url": pilot.url}, "chief": {"url": chief.url}}
        document["recipients"] = {
            "pilot": {"channels": ["mail"]},
            "soon": {"channels": ["chief"], "gliders": ["bruce"], "unacknowledged_minutes": 0.03},
            "late": {"channels": ["chief"], "gliders": ["lena"], "unacknowledged_minutes": 60},
        }
        site.config.write_text(json.dumps(document), encoding="utf-8")
        with Daemon(site) as daemon:
            for glider, mission in zip(GLIDERS, missions, strict=True):
                for file in arrivals(mission):
                    site.put(glider, file.name, file.data)
            until(lambda: len(pilot.mails) == 2, "the pilot is told of both")
            daemon.kill()
        (held,) = [h for h in site.status()["held"] if h["alert"].startswith("lena/")]
        assert held["unless_acknowledged"]
        shown = command("status", "-c", site.config).stdout
        assert f", unless acknowledged: {held['alert']} by chief" in shown
        done = command("ack", held["alert"].rpartition("/")[0], "--by", "Ann", "-c", site.config)
        assert done.returncode == 0, done.stderr
        with Daemon(site) as daemon:
            until(lambda: chief.mails, "the chief is told")
            until(lambda: site.undelivered() == 0, "nothing is left to tell")
    assert len(chief.times()) == 1
    assert "NOT ACKNOWLEDGED bruce SLOW" in chief.mails[0].subject
    assert "gliderwatch ack bruce/anomaly/" in chief.mails[0].text
    assert TRACEBACK not in daemon.text()
