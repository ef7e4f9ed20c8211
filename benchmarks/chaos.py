"""Faults of all kinds at random moments of a live feed: prints what was lost or told twice.

    python benchmarks/chaos.py [--minutes 30] [--seed 1]

Six simulated gliders send their files, out of order, cut short and twice, to a dockserver that the daemon as
installed watches, while faults come and go beside each other. In the last fifth of the time it is not killed
any more: its memory and open files are compared. At the end all faults go; then state and messages are
compared with one undisturbed replay of the same files. Ends with 1 where anything differs, and then keeps
the folder.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
import time
from collections import Counter
from contextlib import ExitStack, suppress
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from common import machine, memory
from faults import Faults
from places import Enemy, Places
from sinks import Moody, Sinks
from storm import Lane, Storm
from vitals import Vitals

from acceptance.angus import MISSION
from acceptance.chaos import differences
from acceptance.support import Site, mail_server

_CHANNELS = ("pilot", "boat")
_NOT_HERE = """not injected here, for it takes the program or the whole machine; each has a test in tests/:
  web hook 429 and 500, DNS gone, limit of inotify watches, leap day and DST,
  state file destroyed wholly (then open incidents are told again)"""


def main(minutes: float, seed: int) -> int:
    """Run it; the exit code."""
    print(machine(), flush=True)
    folder = Path(tempfile.mkdtemp(prefix="gliderwatch-chaos-"))
    with ExitStack() as stack:
        servers = {name: stack.enter_context(ExitStack()) for name in _CHANNELS}
        boxes = {name: Moody() for name in _CHANNELS}
        for name in _CHANNELS:
            servers[name].enter_context(mail_server(boxes[name]))
        storm = Storm(Site(folder), seed, 60.0 * minutes, boxes)
        stack.callback(storm.disk.end)
        stack.enter_context(storm.ending())
        _configure(storm)
        enemy, vitals = Enemy(storm), Vitals(storm)
        storm.blow(_lanes(storm, enemy, vitals, Sinks(storm, servers, boxes)))
        print(f"{storm.clock()} all faults are over", flush=True)
        storm.settle(enemy.is_named)
        enemy.remove()
        vitals.measure("end")
        storm.end()
        found = [*storm.complaints(), *differences(storm, boxes), *vitals.growth(), *_left(storm)]
        _report(storm, enemy, vitals)
        if found:
            shutil.copytree(storm.site.state.parent, folder / "kept")
    print("\n".join(found) or "no difference from one undisturbed replay")
    if found:
        print(f"kept for you: {folder}")
    else:
        shutil.rmtree(folder)
    return 1 if found else 0


def _configure(storm: Storm) -> None:
    """Two people, each with a channel: one that is refused at times, and one that never is for good."""
    site, gliders = storm.site, storm.gliders
    site.caches(MISSION)
    site.configure(*gliders, "angus", rescan_seconds=5)
    document = json.loads(site.config.read_text(encoding="utf-8"))
    document["channels"] = {name: {"url": box.url} for name, box in storm.boxes.items()}
    document["recipients"] = {
        name: {"channels": [name], "surfacing": gliders, "operator": True} for name in storm.boxes
    }
    site.config.write_text(json.dumps(document, indent=1), encoding="utf-8")


def _lanes(storm: Storm, enemy: Enemy, vitals: Vitals, sinks: Sinks) -> list[Lane]:
    """What goes on beside each other; the first is let go of first."""
    faults, (pilot, boat) = Faults(storm), _CHANNELS
    return [
        storm.lane(10, 30, Places(storm).kinds()),
        storm.feed(),
        faults.kills(),
        storm.lane(2, 10, faults.signals()),
        storm.lane(8, 20, faults.states()),
        storm.lane(5, 20, faults.clocks()),
        storm.lane(3, 12, faults.copies()),
        storm.lane(5, 15, enemy.kinds()),
        storm.lane(10, 30, sinks.kinds(pilot)),
        storm.lane(10, 30, [*sinks.kinds(boat), sinks.for_good(boat)]),
        vitals.lane(),
        _progress(storm),
    ]


def _progress(storm: Storm) -> Lane:
    while True:
        yield 60.0 - (time.monotonic() - storm.begun) % 60.0
        tally, mails = storm.tally, sum(len(box.mails) for box in storm.boxes.values())
        text = f"{storm.clock()} {tally.files} of {storm.total} files, {tally.kills.total()} kills, "
        text += f"{storm.done.total()} other faults, {mails} mails, {memory([storm.daemon.pid])[1]:.0f} MB; "
        wrong = storm.complaints()
        print(text + f"wrong so far: {f'{len(wrong)}, as {wrong[0]}' if wrong else 'nothing'}", flush=True)


def _left(storm: Storm) -> list[str]:
    """Files and processes that outlived the daemons."""
    scratch = storm.daemon.scratch
    left = [path.name for path in scratch.iterdir()]
    for path in Path("/proc").glob("[0-9]*/environ"):
        with suppress(OSError):
            if str(scratch).encode() in path.read_bytes():
                left.append(f"process {path.parent.name}")
    return [f"left behind: {', '.join(left)}"] if left else []


def _report(storm: Storm, enemy: Enemy, vitals: Vitals) -> None:
    tally, pss, files = (
        storm.tally,
        vitals.pss,
        {when: len(files) for when, files in vitals.open_files.items()},
    )
    rows: Counter[str] = Counter()
    for where, n in tally.kills.items():
        rows[f"SIGKILL {where.rstrip(' 0123456789')}"] += n
    print(f"\n{'injected':56}  times")
    for name, n in sorted((rows | storm.done).items()):
        print(f"  {name:54} {n:6d}")
    print(_NOT_HERE)
    print(
        f"\n{tally.kills.total()} kills and {storm.done.total()} other faults in {storm.clock().strip()}\n"
        f"{tally.files} files of {len(storm.gliders)} gliders, {enemy.files} hostile files\n"
        f"{tally.copies} copies of the state opened, {len(tally.broken)} broken\n"
        f"{tally.dives} dives, {tally.incidents} incidents, {tally.alerts} messages "
        f"over {len(storm.boxes)} channels\n"
        f"{tally.doubles} came twice, each accepted just before a kill; {tally.refused} refused for good\n"
        f"memory of the daemon {pss['start']:.0f} MB at the start, {pss['end']:.0f} at the end (PSS), "
        f"{vitals.most:.0f} at most (RSS)\n"
        f"open files {files['start']} at the start, of the last daemon {files['young']}, then {files['end']}"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    sys.exit(main(chosen.minutes, chosen.seed))
