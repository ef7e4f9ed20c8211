"""Three dockservers share a field over a broker: one is cut off for a day, daemons are killed on the way."""

from __future__ import annotations

import json
import random
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from acceptance.support import TRACEBACK, Daemon, Mailbox, Site, command, mail_server, until
from broker import Broker, Line, needs_mosquitto
from gliderwatch.config import load
from gliderwatch.fleet.scalar_field import Information
from gliderwatch.service.fields import fields_of
from gliderwatch.simulate.delivery import arrivals
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.ocean import Water
from gliderwatch.simulate.scenario import Mission, Scenario
from gliderwatch.simulate.stand_in import StandIn
from gliderwatch.simulate.telemetry import SCIENCE_CADENCE
from gliderwatch.store.state_file import Status, Store

pytestmark = [needs_mosquitto, pytest.mark.slow]  # three daemons at once, killed at random moments
BOX = {"south": 27.0, "north": 28.0, "west": -84.6, "east": -83.6}


def mission(k: int) -> Mission:
    start = Scenario().start
    water = Water(salinity=35.0, stand_in=StandIn(0.0, 0.0, start))
    science = dict(SCIENCE_CADENCE)
    return simulate(
        Scenario(
            seed=k,
            member=k,
            glider=f"unit_{k}",
            start=start,
            days=1.75,
            interval=4 * 3600.0,
            water=water,
            science=science,
        )
    )


class Dockserver(Site):
    """A site that is a relay, with one glider."""

    def __init__(self, folder: Path, flown: Mission, port: int, mail: Mailbox | None = None) -> None:
        super().__init__(folder)
        self.glider, self.name = flown.scenario.glider, folder.name
        surfacing = [] if mail is None else [self.glider]
        self.configure(self.glider, url=None if mail is None else mail.url, surfacing=surfacing)
        document = YAML(typ="safe").load(self.config)
        document["fields"] = {"upper": {"box": BOX, "depth": [0, 60]}}
        document["relays"] = {"broker": f"mqtt://127.0.0.1:{port}", "name": self.name}
        self.config.write_text(json.dumps(document))
        self.caches(flown)
        self.files_to_come = list(arrivals(flown))
        self.names = {each.final_name for each in self.files_to_come if each.final_name.endswith(".sbd")}

    def arrive(self, part: float) -> None:
        """Let so much of its files come."""
        n = round(part * len(self.files_to_come))
        for file in self.files_to_come[:n]:
            self.put(self.glider, file.final_name, file.data)
        del self.files_to_come[:n]

    def is_done(self) -> bool:
        """Whether all of its files are taken."""
        ledger = self.files()
        return all(name in ledger and ledger[name].status is Status.TAKEN for name in self.names)

    def batches(self) -> set[str]:
        if not self.state.exists():
            return set()
        with closing(Store.reading(self.state)) as store:
            return {row[0] for row in store._db.execute("SELECT id FROM field_batches")}

    def known(self) -> Information:
        (field,) = fields_of(load(self.config))
        with closing(Store.reading(self.state)) as store:
            newest = store.fields.newest("upper", field.params)
            assert newest is not None
            return newest.known


def test_fields_are_equal_in_the_end(tmp_path: Path) -> None:
    chance, missions = random.Random(5), [mission(k) for k in range(3)]
    (tmp_path / "broker").mkdir()
    with ExitStack() as stack:
        broker = stack.enter_context(Broker(tmp_path / "broker"))
        mails, line = stack.enter_context(mail_server()), Line(broker.port)
        ports = (broker.port, broker.port, line.port)
        sites = [
            Dockserver(tmp_path / name, flown, port, mails if name == "c" else None)
            for name, flown, port in zip("abc", missions, ports, strict=True)
        ]
        a, b, c = sites
        daemons = [stack.enter_context(Daemon(site)) for site in sites]

        def killed(k: int) -> None:
            daemons[k].kill()
            daemons[k].start().ready()

        for site in sites:
            site.arrive(0.25)
        until(lambda: a.batches() == b.batches() == c.batches() != set(), "the first batches everywhere")
        line.cut()
        before = len(mails.mails)
        for site in sites:  # a day goes by, in which one is alone
            site.arrive(0.75)
        killed(chance.randrange(2))
        until(lambda: len(mails.mails) > before, "a notice of a surfacing from the one that is alone")
        killed(2)
        until(lambda: a.batches() == b.batches(), "the others are together")
        assert a.batches() != c.batches()
        status = json.loads(command("status", "-c", c.config, "--json").stdout)["relays"]
        assert not status["connected"] and status["batches_to_send"] > 0, status
        line.mend()
        killed(0)
        for site in sites:
            site.arrive(1.0)
        killed(1)
        until(lambda: all(site.is_done() for site in sites), "all files taken", 120)
        until(lambda: a.batches() == b.batches() == c.batches(), "all batches everywhere", 120)
        assert not any(TRACEBACK in daemon.text() for daemon in daemons)
        done = command("doctor", "-c", a.config, "--json").stdout
        assert any(f["topic"] == "relays" and f["level"] == "ok" for f in json.loads(done)["findings"])
    first, *others = (site.known() for site in sites)
    for other in others:
        np.testing.assert_allclose(other.d, first.d, rtol=0, atol=1e-9)
        np.testing.assert_allclose(other.g, first.g, rtol=0, atol=1e-9)
    print(f"{len(a.batches())} batches at each of three relays")
