"""SIGKILL at every commit point and at random moments of a live feed: prints what was lost or told twice.

    python benchmarks/chaos_kill.py [KILLS [SEED [DAYS]]]

Half of the daemons die just before or just after one of their first commits, the others at random, one in six
of these while it starts. Files come meanwhile, out of order, cut short and twice. After each kill the state
is copied as a power cut would leave it, opened and checked. Ends with 1 unless all copies are whole, and
assessments, incidents and segments are those of one undisturbed replay, every message arrived, and one came
twice only where a kill fell between its acceptance and the mark.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from common import machine

from acceptance.chaos import Chaos, differences, fleet
from acceptance.support import TRACEBACK, Site, mail_server


def main(kills: int = 200, seed: int = 1, days: int = 12) -> int:
    """Run it; the exit code."""
    print(machine())
    begun = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="gliderwatch-chaos-") as name, mail_server() as box:
        site, missions = Site(Path(name)), fleet(float(days))
        gliders = [mission.scenario.glider for mission in missions]
        site.caches(*missions)
        site.configure(*gliders, url=box.url, surfacing=gliders)
        chaos = Chaos(site, missions, seed)
        with chaos.daemon:
            chaos.daemon.kill()
            chaos.kill(kills)
            print(f"{kills} kills after {time.monotonic() - begun:.0f} s", flush=True)
            chaos.finish()
        found = differences(chaos, box)
        found += ["a traceback in the log"] if TRACEBACK in chaos.daemon.text() else []
        left = [path.name for path in chaos.daemon.scratch.iterdir()]
        found += [f"left behind: {', '.join(left)}"] if left else []
    _report(chaos, time.monotonic() - begun)
    print("\n".join(found) or "no difference from one undisturbed replay")
    return 1 if found else 0


def _report(chaos: Chaos, seconds: float) -> None:
    tally = chaos.tally
    print(f"{tally.kills.total()} kills in {seconds:.0f} s:")
    for where, n in sorted(tally.kills.items()):
        print(f"  {n:4d} {where}")
    print(f"{tally.files} files came; {tally.copies} copies of the state, of them {len(tally.broken)} broken")
    print(f"{tally.dives} dives, {tally.incidents} incidents, {tally.alerts} messages")
    print(f"{tally.doubles} messages came twice, each accepted just before a kill, with one Message-ID")


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
