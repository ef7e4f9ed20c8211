"""Gliders in a box of the sea: the replay makes a field of their science files, advises, and tells in the
notice."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from netCDF4 import Dataset

from acceptance.support import command
from gliderwatch.simulate import stand_in
from gliderwatch.simulate.delivery import write_cache, write_mission
from gliderwatch.simulate.flight import Point, offset
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.ocean import Water
from gliderwatch.simulate.scenario import Scenario
from gliderwatch.simulate.stand_in import StandIn
from gliderwatch.simulate.telemetry import SCIENCE_CADENCE

CORNER, START, N = Point(50.0, -30.0), Scenario().start, 4
"""The south-western corner of the box."""


def at(east: float, north: float) -> Point:
    lat, lon = offset(CORNER, np.array(east), np.array(north))
    return Point(float(lat), float(lon))


def glider(k: int) -> Scenario:
    rng = np.random.default_rng(k)
    places = [at(*rng.uniform(5e3, 55e3, 2)) for _ in range(6)]
    return Scenario(
        glider=f"unit_{k}",
        member=k,
        start=START,
        days=1.0,
        place=places[0],
        waypoints=tuple(places[1:]),
        origin=CORNER,
        depths=(3.0, 97.0),
        drive=250e-6,
        interval=2 * 3600.0,
        water=Water(salinity=35.0, stand_in=StandIn(0.0, 0.0, START)),
        science=dict(SCIENCE_CADENCE),
    )


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dockserver of four gliders, and a replay of it."""
    folder = tmp_path_factory.mktemp("fleet")
    for k in range(N):
        mission = simulate(glider(k))
        write_mission(folder / "gliders", folder / "cache", mission)
        write_cache(folder / "cache", mission)
    north_east = at(60e3, 60e3)
    box = f"{{south: 50.0, west: -30.0, north: {north_east.lat}, east: {north_east.lon}}}"
    (folder / "gliderwatch.yml").write_text(f"""
dockserver: {{roots: [gliders], cache: [cache]}}
state: {{path: state.sqlite}}
fields:
  upper: {{box: {box}, depth: [0, 100], advice: {{outputs: out, apart_km: 2}}}}
  salt: {{box: {box}, depth: [0, 100], sensor: salinity}}
gliders: {{{", ".join(f"unit_{k}: " for k in range(N))}}}
channels: {{mail: {{url: "mailto://127.0.0.1:1?from=a@b.c&to=d@e.f"}}}}
recipients: {{pilots: {{channels: [mail], min_severity: info, surfacing: [{
        ", ".join(f"unit_{k}" for k in range(N))
    }]}}}}
""")
    done = command("run", "--replay", "gliders", "-c", "gliderwatch.yml", "--out", "results", cwd=folder)
    assert done.returncode == 0, done.stderr
    (folder / "printed").write_text(done.stdout)
    return folder


def test_the_field_of_the_fleet_is_that_of_the_sea(site: Path) -> None:
    state = "results/replay.sqlite"
    done = command("field", "upper", "-c", "gliderwatch.yml", "--state", state, "--out", "u.nc", cwd=site)
    assert done.returncode == 0, done.stderr
    with Dataset(site / "u.nc") as file:
        assert file.Conventions == "CF-1.8, ACDD-1.3"
        assert file.geospatial_vertical_max == 100.0
        found, error = file["temperature"][0].data, file["temperature_error"][0].data
        assert file["temperature"].standard_name == "sea_water_temperature"
        assert file["temperature"].units == "degree_Celsius"
        t = float(file["time"][0])
        axes = [np.linspace(0, 1, n) for n in found.shape]
    z, y, x = np.meshgrid(*axes, indexing="ij")
    truth = stand_in.temperature(np.stack([x, y, z], -1), t - START)
    off = found - stand_in.MEAN - truth
    assert np.sqrt(np.mean(off**2)) < 0.2 * np.sqrt(np.mean(truth**2))
    assert 0.1 < np.mean(np.square(off / error)) < 3
    near = error < np.quantile(error, 0.2)
    assert np.sqrt(np.mean(off[near] ** 2)) < np.sqrt(np.mean(off**2))


def test_salinity_is_that_of_the_water(site: Path) -> None:
    state = "results/replay.sqlite"
    done = command("field", "salt", "-c", "gliderwatch.yml", "--state", state, "--out", "maps/s.nc", cwd=site)
    assert done.returncode == 0, done.stderr
    with Dataset(site / "maps/s.nc") as file:
        assert np.abs(file["salinity"][0, 1:-1] - 35.0).max() < 0.1  # nobody was at the top and the bottom


def test_the_notice_of_a_surfacing_says_where_to_look(site: Path) -> None:
    told = (site / "results" / "alerts.jsonl").read_text()
    lines = re.findall(r"Look next for upper: steer \d{3} deg true to [^\\]*%", told)
    assert len(lines) > 10, told[:3000]


def test_no_such_field_and_no_samples_are_said(site: Path) -> None:
    wrong = command("field", "lower", "-c", "gliderwatch.yml", "--out", "x.nc", cwd=site)
    assert wrong.returncode == 2
    assert "known are: salt, upper" in wrong.stderr
    early = command("field", "upper", "-c", "gliderwatch.yml", "--state", "results/replay.sqlite",
                    "--at", "2001-01-01", "--out", "x.nc", cwd=site)  # fmt: skip
    assert early.returncode == 2
    assert "no samples for the field upper" in early.stderr


def test_pages_show_the_field_how_well_it_is_known_and_where_to_look(site: Path) -> None:
    done = command("pages", "--state", "results/replay.sqlite", "--out", "pages", cwd=site)
    assert done.returncode == 0, done.stderr
    text = (site / "pages" / "unit_0.html").read_text()
    assert re.search(r"Look next.{0,200}for upper: heading \d+°", text, re.S)
    assert 'href="field.upper.html">upper</a>' in text
    assert 'href="field.upper.html">upper</a>' in (site / "pages" / "index.html").read_text()
    page = site / "pages" / "field.upper.html"
    text = page.read_text()
    assert page.stat().st_size < 150_000
    assert "4 gliders in it now" in text
    assert text.count('<svg class="field"') == 4  # map and section, of values and of errors
    assert text.count('<circle class="next"') >= 2 * 2  # on both maps: what is advised
    numbers = re.search(r"to place: (\S+) to (\S+) °C.*to (\S+) °C at best, to (\S+) in", text, re.S)
    assert numbers is not None
    low, high, best, worst = map(float, numbers.groups())
    assert 10 < low < high < 30 and 0 < best < worst < 5
