"""The daemon makes advice of a science file, also of one that comes after its flight file was assessed."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from acceptance.support import Daemon, Site, until

pytestmark = pytest.mark.real
NAME = "usf-sam-2019-251-4-16"


def test_a_science_file_that_comes_late_makes_the_mission_arguments(site: Site, shared_data: Path) -> None:
    mission, out = shared_data / "usf-sam-2019", site.config.with_name("advice")
    for cache in (mission / "cache").iterdir():
        shutil.copy(cache, site.cache)
    site.configure("usf-sam")
    settings = json.loads(site.config.read_text())
    settings["gliders"]["usf-sam"] = {"layers": {"max_depth": 60, "altitude": 4, "outputs": str(out)}}
    site.config.write_text(json.dumps(settings))
    with Daemon(site) as daemon:
        site.put("usf-sam", f"{NAME}.sbd", (mission / "from-glider" / f"{NAME}.sbd").read_bytes())
        until(lambda: daemon.log("file taken"), "the flight file is taken")
        assert not out.exists()
        site.put("usf-sam", f"{NAME}.tbd", (mission / "from-glider" / f"{NAME}.tbd").read_bytes())
        until((out / "usf-sam-yo-band.ma").exists, "the mission arguments are written")
        assert "d_target_depth(m)" in (out / "usf-sam-yo-band.ma").read_text()
        until(lambda: daemon.log("advice written"), "it is in the log")  # after the files
        (written,) = daemon.log("advice written")
        assert written["glider"] == "usf-sam"
    kept = {path.name for path in site.root.rglob("*") if path.is_file()}
    assert kept == {f"{NAME}.sbd", f"{NAME}.tbd"}  # nothing is put where a glider might get it
