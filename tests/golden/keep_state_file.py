"""Keep a state file of today's schema for the tests of later upgrades.

`python tests/golden/keep_state_file.py`: run it on the commit *before* the one that changes the
schema or a checkpoint, and commit what it writes:

- ``schema-N.sqlite.gz``: a simulated glider that a remora slows, its messages delivered, cut as
  `state.keep_days` cuts, so that what came before the first checkpoint cannot be made again;
- ``schema-N-goes-on.json.gz``: the segments that come next, and what today's code makes of them.
"""

import base64
import gzip
import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

sys.path[:0] = [str(Path(__file__).parents[1])]

from gliderwatch.ingest.decode import decode  # noqa: E402
from gliderwatch.model import Segment  # noqa: E402
from gliderwatch.run.intake import Speaking  # noqa: E402
from gliderwatch.simulate import job  # noqa: E402
from gliderwatch.store import codec  # noqa: E402
from gliderwatch.store.database import SCHEMA  # noqa: E402
from gliderwatch.store.sqlite import Store  # noqa: E402
from missions import feed  # noqa: E402

NEXT, KEPT = 3, 5
"""Segments that come after the state file was kept, and dives that the cut leaves in it."""
SPEAKING = Speaking(channels=lambda alert: ["mail"], notices=lambda glider: False)


def simulated(folder: Path) -> list[Segment]:
    """The segments of a glider of five days that a remora slows on the fifth, in order of time."""
    job.run(job.Job(folder, job.gliders("calm", 1, 5.0, 5, ["remora:6@4.5"], False)))
    paths = [p for p in sorted(folder.glob("gliders/*/from-glider/*")) if p.suffix in (".sbd", ".scd")]
    return sorted((decode(path, [folder / "cache"]) for path in paths), key=lambda s: s.id)


def outcome(store: Store, glider: str) -> dict[str, object]:
    """What a state file says of a glider, as plain JSON."""
    said = {
        "assessments": store.assessments(glider),
        "incidents": store.incidents(glider),
        "expected": store.forecasts(glider),
        "alerts": store.alerts(),
    }
    return {name: json.loads(codec.plain_encode(values)) for name, values in said.items()}


def main() -> None:
    """Write both files beside this script."""
    here = Path(__file__).parent
    with TemporaryDirectory() as folder:
        made = simulated(Path(folder))
        path = Path(folder) / "state.sqlite"
        store = feed(made[:-NEXT], speaking=SPEAKING, store=Store.open(path))
        glider = made[0].id.glider
        store._db.execute("UPDATE outbox SET delivered_at = 1.0")
        removed = sum(store.remove(made[-NEXT - KEPT].id.opened_at))
        store._db.execute("VACUUM")
        store._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        kept = path.read_bytes()
        feed(made[-NEXT:], speaking=SPEAKING, store=store)
        after = outcome(store, glider)
        store.close()
    after["segments"] = [base64.b64encode(codec.encode(s)).decode() for s in made[-NEXT:]]
    (here / f"schema-{SCHEMA}.sqlite.gz").write_bytes(gzip.compress(kept, mtime=0))
    text = json.dumps(after).encode()
    (here / f"schema-{SCHEMA}-goes-on.json.gz").write_bytes(gzip.compress(text, mtime=0))
    print(f"{len(made)} segments, {removed} rows removed, alerts: {[a['title'] for a in after['alerts']]}")


if __name__ == "__main__":
    main()
