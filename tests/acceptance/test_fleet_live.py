"""A fleet in one sea, on one field: a daemon that got its files in disorder, late and with a kill between
knows what a replay knows."""

from __future__ import annotations

import json
import math
import random
from pathlib import Path

import numpy as np
import pytest

from acceptance.support import Daemon, Site, until
from gliderwatch.config import load
from gliderwatch.fleet.reference import beside_neighbours
from gliderwatch.fleet.scalar_field import estimate
from gliderwatch.model import Array, Assessment
from gliderwatch.service.fields import fields_of
from gliderwatch.service.replay import Request, replay
from gliderwatch.simulate.delivery import Arrival, arrivals
from gliderwatch.simulate.flight import Point
from gliderwatch.simulate.glider import fleet, simulate
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.simulate.telemetry import SCIENCE_CADENCE
from gliderwatch.store.state_file import Status, Store

N, LATE = 3, 4
BASE = Scenario(
    glider="unit", days=0.4, place=Point(50.0, -30.0), interval=5400.0, science=dict(SCIENCE_CADENCE)
)


def seen(state: Path, config: Path) -> tuple[list[Assessment], Array]:
    """The dives beside their neighbours, and the field and its error at some places, by a state file."""
    with Store.looking(state) as store:
        dives = [store.assessments(glider) for glider in store.gliders()]
        (field,) = fields_of(load(config))
        newest = store.fields.newest(field.name, field.params)
        assert newest is not None
        places = np.random.default_rng(1).random((50, 3))
        return beside_neighbours([d for own in dives for d in own], dives), np.concatenate(
            estimate(newest.known, places, field.params)
        )


def batches(state: Path) -> int:
    """How many batches of samples there are."""
    with Store.looking(state) as store:
        extent = store.fields.extent("upper")
    return 0 if extent is None else extent[0]


@pytest.mark.slow  # a daemon that is killed, and fifty files
def test_a_daemon_and_a_replay_of_a_fleet_agree(tmp_path: Path) -> None:
    site, missions = Site(tmp_path), [simulate(each) for each in fleet(BASE, N)]
    site.caches(*missions)
    site.configure(*(mission.scenario.glider for mission in missions))
    settings = json.loads(site.config.read_text())
    box = {"south": 49.7, "west": -30.4, "north": 50.3, "east": -29.6}
    settings["fields"] = {"upper": {"box": box, "depth": [0, 100], "sensor": "sci_water_temp"}}
    site.config.write_text(json.dumps(settings))
    files = [(mission.scenario.glider, each) for mission in missions for each in arrivals(mission)]
    first = [each.final_name for glider, each in files if glider == files[0][0]][:LATE]  # a call that fails
    late = [each for each in files if each[1].final_name in first]
    rest = [each for each in files if each[1].final_name not in first]
    random.Random(3).shuffle(rest)

    def put(some: list[tuple[str, Arrival]]) -> None:
        for glider, each in some:
            site.put(glider, each.final_name, each.data)

    def taken(some: list[tuple[str, Arrival]]) -> bool:
        flights = [e.final_name for _, e in some if e.final_name.endswith("sbd")]
        return all(status is Status.TAKEN for status in site.statuses(*flights))

    with Daemon(site) as daemon:
        put(rest[: len(rest) // 2])
        until(lambda: len(site.files()) > N, "at work")
        daemon.kill()
        put(rest[len(rest) // 2 :])
        daemon.start()
        until(lambda: taken(rest), "all but the late files are taken")
        put(late)
        until(lambda: taken(files), "the late files are taken")
        replay(Request((site.root,), (site.cache,), load(site.config), out=tmp_path / "out"))
        replayed = tmp_path / "out" / "replay.sqlite"
        until(lambda: batches(site.state) == batches(replayed), "the science files are taken")
        daemon.stop()
    (live, field), (again, field_again) = (seen(state, site.config) for state in (site.state, replayed))
    beside = [dive for dive in live if "fleet_u" in dive.evidence]
    assert len(beside) > N
    assert all(math.isfinite(dive.evidence["fused_u"]) for dive in beside)
    assert live == again
    np.testing.assert_allclose(field, field_again, rtol=1e-9)  # here BLAS has threads, and sums in any order
