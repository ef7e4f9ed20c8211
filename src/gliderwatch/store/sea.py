"""The sea in a state file: fields of a fleet (batches, checkpoints, soundings, advice), layers of gliders."""

from __future__ import annotations

import itertools
import sqlite3
from collections.abc import Iterable
from math import inf

import numpy as np

from gliderwatch.errors import DamagedError
from gliderwatch.fleet.advice import Advice
from gliderwatch.fleet.batches import packed, unpacked
from gliderwatch.fleet.constants import BIN
from gliderwatch.fleet.scalar_field import Batch, Checkpoint, FieldParams, Information, run
from gliderwatch.layers.advice import Layered
from gliderwatch.model import Array, SegmentId, readonly
from gliderwatch.store import codec
from gliderwatch.store.codec import values
from gliderwatch.store.database import crc_of_batch

BLOCK = 6
"""Bins of which one checkpoint is written: half a megabyte each. Those between are made again when needed."""
RECENT = 12
"""Newest checkpoints that are kept, three days; of the older ones one in four is, a day's."""
LAST = 90
"""Checkpoints that are kept at all. For what comes still later the field is made again from its first
batch."""
SOUNDING = 0.01
"""Degrees: side of the cells of which the least water depth is kept."""


class Fields:
    """The fields of a fleet, on the connection of its store.

    What is known after the newest bins is held in memory too: nearly all surfacings go on from there.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection
        self._newest: dict[str, tuple[Checkpoint, ...]] = {}

    def rollback(self) -> None:
        """What was written since the last commit is not there: hold nothing of it."""
        self._newest.clear()

    def begin(self, field: str, key: str) -> bool:
        """Begin a field again where `key`, that of its settings, is another than before; whether it was."""
        if self.settings(field) == key:
            return False
        self._db.execute("INSERT OR REPLACE INTO field_settings VALUES (?, ?)", (field, key))
        for table in ("field_batches", "field_checkpoints", "field_soundings", "field_advice"):
            self._db.execute(f"DELETE FROM {table} WHERE field = ?", (field,))
        self._newest.pop(field, None)
        return True

    def put(self, field: str, batches: Iterable[Batch], *, is_shared: bool = False) -> bool:
        """Take batches in and drop the checkpoints after them; False where all is there already.

        Of two batches of one id the one with more samples stays. ``is_shared``: other relays are to get them.
        """
        first = inf
        for batch in batches:
            data, kept = packed(batch), self._batch(field, batch.id)
            if kept is not None and (len(kept.t), packed(kept)) >= (len(batch.t), data):
                continue
            first = min(first, *(float(each.t[0]) for each in (batch, kept) if each is not None))
            crc, times = crc_of_batch(batch.id, data), (float(batch.t[0]), float(batch.t[-1]))
            row = (field, batch.id, batch.glider, *times, data, crc, is_shared)
            self._db.execute("INSERT OR REPLACE INTO field_batches VALUES (?, ?, ?, ?, ?, ?, ?, ?)", row)
        if first == inf:
            return False
        self._db.execute("DELETE FROM field_checkpoints WHERE field = ? AND bin >= ?", (field, first // BIN))
        held = self._newest.get(field, ())
        self._newest[field] = tuple(each for each in held if each.bin < first // BIN)
        return True

    def advance(self, field: str, params: FieldParams, most: int | None = None) -> Checkpoint | None:
        """Go on to the last samples, or by ``most`` bins, and write checkpoints on the way: what is known
        then."""
        held = self._newest.get(field, ())
        start = held[-1] if held else self._start(field, inf)
        after = run(start, self.batches(field, start), params, most)
        whole = after if start is None else (start, *after)
        self._newest[field] = (*held[:-1], *whole)[-2 * BLOCK :]
        written = [a for a, b in itertools.pairwise(whole) if a.bin // BLOCK < b.bin // BLOCK]
        rows = [(field, each.bin, _bytes(each.known)) for each in written]
        self._db.executemany("INSERT OR REPLACE INTO field_checkpoints VALUES (?, ?, ?)", rows)
        self._thin(field)
        return whole[-1] if whole else None

    def keep_up(self, field: str, params: FieldParams) -> None:
        """As `advance`, once samples of more than a block of bins have come: who looks at a field has no more
        than that to wait for."""
        held = self._newest.get(field, ())
        start = held[-1] if held else self._start(field, inf)
        sql = "SELECT max(last_t) FROM field_batches WHERE field = ?"
        last = self._db.execute(sql, (field,)).fetchone()[0]
        if last is not None and (start is None or last // BIN > start.bin + BLOCK):
            self.advance(field, params)

    def newest(self, field: str, params: FieldParams) -> Checkpoint | None:
        """What is known of a field after its last samples; None: there are none."""
        return self.before(field, inf, params)

    def before(self, field: str, t: float, params: FieldParams) -> Checkpoint | None:
        """What is known of a field by samples of bins before that of a time (s)."""
        last = t // BIN if t < inf else inf
        held = [each for each in self._newest.get(field, ()) if each.bin < last]
        start = held[-1] if held else self._start(field, last)
        after = run(start, self.batches(field, start), params)
        found = [each for each in after if each.bin < last]
        return found[-1] if found else start

    def settings(self, field: str) -> str | None:
        """The key of the settings that a field was begun with; None: there is no such field."""
        row = self._db.execute("SELECT key FROM field_settings WHERE field = ?", (field,)).fetchone()
        return None if row is None else str(row[0])

    def names(self) -> list[str]:
        """The fields of which there are batches."""
        sql = "SELECT DISTINCT field FROM field_batches ORDER BY field"
        return [row[0] for row in self._db.execute(sql)]

    def extent(self, field: str) -> tuple[int, float, float] | None:
        """How many batches a field has, and the times (s) of its first and last samples; None: no batch."""
        sql = "SELECT count(*), min(first_t), max(last_t) FROM field_batches WHERE field = ?"
        row = self._db.execute(sql, (field,)).fetchone()
        return None if not row[0] else (row[0], row[1], row[2])

    def _thin(self, field: str) -> None:
        sql = "SELECT bin FROM field_checkpoints WHERE field = ? ORDER BY bin DESC"
        bins = [row[0] for row in self._db.execute(sql, (field,))]
        days = {b // (4 * BLOCK): b for b in bins[RECENT:][::-1]}
        gone = set(bins[RECENT:]) - set(days.values()) | set(bins[LAST:])
        sql = "DELETE FROM field_checkpoints WHERE field = ? AND bin = ?"
        self._db.executemany(sql, [(field, b) for b in gone])

    def _start(self, field: str, last: float) -> Checkpoint | None:
        """The newest written checkpoint of a bin before another."""
        sql = "SELECT bin, data FROM field_checkpoints WHERE field = ? AND bin < ? ORDER BY bin DESC LIMIT 1"
        row = self._db.execute(sql, (field, last)).fetchone()
        return None if row is None else Checkpoint(row[0], _information(row[1]))

    def batches(self, field: str, start: Checkpoint | None = None) -> list[Batch]:
        """The batches of a field with samples after a checkpoint (None: all), in no order."""
        sql = "SELECT id, glider, data FROM field_batches WHERE field = ? AND last_t >= ?"
        since = -inf if start is None else (start.bin + 1) * BIN
        return [_batch(row) for row in self._db.execute(sql, (field, since))]

    def _batch(self, field: str, identity: str) -> Batch | None:
        sql = "SELECT id, glider, data FROM field_batches WHERE field = ? AND id = ?"
        row = self._db.execute(sql, (field, identity)).fetchone()
        return None if row is None else _batch(row)

    # ----------------------------------------------------------------- advice

    def sound(self, field: str, soundings: Array) -> None:
        """Keep water depths ((n, 3): latitude, longitude, m): of each cell the least."""
        rows = [(field, round(lat / SOUNDING), round(lon / SOUNDING), depth) for lat, lon, depth in soundings]
        self._db.executemany(
            "INSERT INTO field_soundings VALUES (?, ?, ?, ?) ON CONFLICT (field, lat, lon) "
            "DO UPDATE SET depth = min(depth, excluded.depth)",
            rows,
        )

    def soundings(self, field: str) -> Array:
        """The water depths that are known, as they were given."""
        sql = "SELECT lat * ?2, lon * ?2, depth FROM field_soundings WHERE field = ?1"
        return readonly(np.array([tuple(r) for r in self._db.execute(sql, (field, SOUNDING))]).reshape(-1, 3))

    def advise(self, field: str, glider: str, t: float, advice: Advice | None) -> None:
        """Keep what is advised to a glider at a surfacing (s), in place of what was before; None: nothing."""
        if advice is None:
            sql = "DELETE FROM field_advice WHERE field = ? AND glider = ?"
            self._db.execute(sql, (field, glider))
        else:
            row = (field, glider, t, codec.plain_encode(advice))
            self._db.execute("INSERT OR REPLACE INTO field_advice VALUES (?, ?, ?, ?)", row)

    def advice(self, glider: str, since: float) -> list[tuple[str, float, Advice]]:
        """What is advised to a glider, by field: its name, the surfacing (s), the advice; not older ones."""
        sql = "SELECT field, t, data FROM field_advice WHERE glider = ? AND t >= ? ORDER BY field"
        rows = self._db.execute(sql, (glider, since))
        return [(row[0], row[1], codec.plain_decode(row[2], Advice)) for row in rows]


def _batch(row: sqlite3.Row) -> Batch:
    try:
        return unpacked(row["data"], row["id"], row["glider"])
    except ValueError as error:
        raise DamagedError(f"a record of the state file is damaged: {error}") from error


def _bytes(known: Information) -> bytes:
    """The lower triangle of D, and g: little-endian float64."""
    lower = known.d[np.tril_indices(len(known.g))]
    return np.concatenate([lower, known.g]).astype("<f8").tobytes()


def _information(data: bytes) -> Information:
    """What those bytes say. Raises DamagedError."""
    numbers = np.frombuffer(data[: len(data) // 8 * 8], dtype="<f8")
    n = int((np.sqrt(9 + 8 * len(numbers)) - 3) / 2)
    if n < 1 or n * (n + 3) // 2 != len(numbers) or not np.isfinite(numbers).all():
        raise DamagedError("a record of the state file is damaged: no checkpoint of a field")
    d = np.zeros((n, n))
    d[np.tril_indices(n)] = numbers[:-n]
    return Information(d + np.tril(d, -1).T, numbers[-n:])


class LayerRows:
    """The layers of all gliders, on the connection of their store."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection

    def before(self, identity: SegmentId) -> Layered | None:
        """What was known of a glider's layers before a segment; None: nothing."""
        sql = (
            "SELECT data FROM layers WHERE glider = ? AND (opened_at, segment) < (?, ?) "
            "ORDER BY opened_at DESC, segment DESC LIMIT 1"
        )
        key = (identity.glider, identity.opened_at, identity.name)
        return next(iter(values(self._db, sql, key, Layered)), None)

    def keep(self, identity: SegmentId, found: Layered | None) -> None:
        """Keep what is known after a segment, in place of what was kept of it; None: nothing."""
        key = (identity.glider, identity.opened_at, identity.name)
        self._db.execute("DELETE FROM layers WHERE glider = ? AND opened_at = ? AND segment = ?", key)
        if found is not None:
            row = (*key, found.advice.t, codec.plain_encode(found))
            self._db.execute("INSERT INTO layers VALUES (?, ?, ?, ?, ?)", row)

    def segments(self, glider: str, n: int) -> list[tuple[SegmentId, Layered]]:
        """The last `n` segments of a glider with what was found in each, in order of time."""
        sql = (
            "SELECT opened_at, segment, data FROM layers WHERE glider = ? "
            "ORDER BY opened_at DESC, segment DESC LIMIT ?"
        )
        rows = self._db.execute(sql, (glider, n)).fetchall()
        return [
            (SegmentId(row["opened_at"], glider, row["segment"]), codec.plain_decode(row["data"], Layered))
            for row in reversed(rows)
        ]
