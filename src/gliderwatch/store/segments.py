"""The segments of each glider in a state file, on the right clock, and the checkpoints after them."""

from __future__ import annotations

import sqlite3
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace

from gliderwatch.model import NextSurfacing, Segment, SegmentId
from gliderwatch.navigation.clock import (
    ClockStep,
    Correction,
    MissionClock,
    Stamp,
    corrections,
    mission_clock,
    moved,
    numbered,
)
from gliderwatch.navigation.constants import SAME_OPENING
from gliderwatch.navigation.flight import downsample
from gliderwatch.pipeline import GliderState
from gliderwatch.store import codec

# ----------------------------------------
# The clocks of gliders in a state file: segments get their right place in time (`navigation.clock`).

FIRST = 2
"""`milestone` of a segment before which nothing is kept any more."""
_COLUMNS = "name, opened_at, clock_offset, clock_step, last_t, milestone"
_OF_MISSION = "glider = ? AND name >= ? AND name < ?"


def _names(mission: str) -> tuple[str, str]:
    """The names of the segments of a mission lie between these: "." is the character after "-"."""
    return f"{mission}-", f"{mission}."


class MissionClocks:
    """The clock of each mission that was looked at, in memory, so that the next segment costs no look at all
    segments before it. What only the whole mission can tell is looked up there."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection
        self._clocks: dict[tuple[str, str], MissionClock] = {}
        self._unsure: set[str] = set()

    def clear(self) -> None:
        """Know nothing: what is in the state file is another than it was."""
        self._clocks.clear()

    def commit(self) -> None:
        """What was corrected since the last time is in the state file."""
        self._unsure.clear()

    def rollback(self) -> None:
        """It is not: know nothing of those gliders."""
        self._clocks = {key: clock for key, clock in self._clocks.items() if key[0] not in self._unsure}
        self._unsure.clear()

    def correct(self, identity: SegmentId, last_t: float) -> dict[SegmentId, SegmentId]:
        """Put the segments of a mission where they belong in time, after one was put there by its own clock,
        which has its last sample at ``last_t`` (s); the ids before and after of those moved."""
        glider, name = identity.glider, identity.name
        self._unsure.add(glider)
        mission, number = numbered(name)
        stamp = Stamp(number, identity.opened_at, last_t)
        clock = self._clocks.get((glider, mission))
        new = None if clock is None else clock.next(stamp)
        if clock is None or new is None:
            return self._correct_all(glider, mission)
        self._clocks[glider, mission] = replace(clock, newest=stamp, offset=new.offset)
        if new == Correction():
            return {}
        before = SegmentId(stamp.opened_at, glider, name)
        after = replace(before, opened_at=stamp.opened_at + new.offset)
        _move(self._db, before, after, new)
        return {before: after}

    def _correct_all(self, glider: str, mission: str) -> dict[SegmentId, SegmentId]:
        rows, stamps = _rows(self._db, glider, mission)
        found = corrections(stamps, _start(rows))
        self._clocks.pop((glider, mission), None)
        if (clock := mission_clock(stamps, found)) is not None:
            self._clocks[glider, mission] = clock
        moves = {}
        for row, stamp, new in zip(rows, stamps, found, strict=True):
            if new == _correction(row):
                continue
            before = SegmentId(row["opened_at"], glider, row["name"])
            after = SegmentId(stamp.opened_at + new.offset, glider, row["name"])
            _move(self._db, before, after, new)
            moves[before] = after
        return moves

    def offset(self, identity: SegmentId) -> float:
        """What would be added to the time of a segment (s) if it came now; by the glider's clock."""
        mission, number = numbered(identity.name)
        own = Stamp(number, identity.opened_at, identity.opened_at)
        clock = self._clocks.get((identity.glider, mission))
        if clock is not None and (found := clock.next(own)) is not None:
            return found.offset
        rows, stamps = _rows(self._db, identity.glider, mission, but=identity.name)
        return corrections([own, *stamps], _start(rows))[0].offset


def _rows(
    db: sqlite3.Connection, glider: str, mission: str, but: str = ""
) -> tuple[list[sqlite3.Row], list[Stamp]]:
    """The segments of a mission in the order of their numbers, without those of one name; their stamps."""
    sql = f"SELECT {_COLUMNS} FROM segments WHERE {_OF_MISSION} AND name != ?"
    rows = db.execute(sql, (glider, *_names(mission), but)).fetchall()
    numbers = {row["name"]: numbered(row["name"])[1] for row in rows}
    rows.sort(key=lambda row: numbers[row["name"]])
    return rows, [Stamp(numbers[r["name"]], r["opened_at"] - r["clock_offset"], r["last_t"]) for r in rows]


def _correction(row: sqlite3.Row) -> Correction:
    return Correction(row["clock_offset"], row["clock_step"])


def _start(rows: Sequence[sqlite3.Row]) -> Correction:
    """What was known at the first segment, where `state.keep_days` has removed those before it."""
    return _correction(rows[0]) if rows and rows[0]["milestone"] == FIRST else Correction()


def _move(db: sqlite3.Connection, before: SegmentId, after: SegmentId, correction: Correction) -> None:
    """Give a segment its place in time, and its sign of life with it."""
    key = (before.glider, before.opened_at, before.name)
    db.execute(
        "UPDATE segments SET opened_at = ?, clock_offset = ?, clock_step = ?, checkpoint = NULL "
        "WHERE glider = ? AND opened_at = ? AND name = ?",
        (after.opened_at, correction.offset, correction.step, *key),
    )
    db.execute(
        "UPDATE heard SET opened_at = opened_at - clock_offset + ?1, last_t = last_t - clock_offset + ?1, "
        "clock_offset = ?1 WHERE glider = ?2 AND segment = ?3 AND abs(opened_at - ?4) <= ?5",
        (correction.offset, before.glider, before.name, before.opened_at, SAME_OPENING),
    )
    for table in ("expected", "layers"):
        db.execute(f"DELETE FROM {table} WHERE glider = ? AND opened_at = ? AND segment = ?", key)


def steps(db: sqlite3.Connection, glider: str) -> list[ClockStep]:
    """Where the clock of a glider was set back, or is right again, in order of time.

    The right time of one that is not corrected is not known: that of the newest segment of its mission stands
    for it.
    """
    rows = db.execute(
        "SELECT name, opened_at, clock_offset, clock_step FROM segments WHERE glider = ? AND clock_step != 0",
        (glider,),
    )
    found = [ClockStep(glider, *row) for row in rows]
    newest = f"SELECT max(opened_at) FROM segments WHERE {_OF_MISSION}"
    for i, step in enumerate(found):
        if not step.is_corrected:
            mission = numbered(step.segment)[0]
            t = db.execute(newest, (glider, *_names(mission))).fetchone()[0]
            found[i] = replace(step, t=t)
    return sorted(found, key=lambda step: step.t)


# ----------------------------------------
# The segments of each glider in a state file, and the checkpoints after them.

# ----------------------------------------
# States of gliders that are ahead of their checkpoints: while a long list of files is taken in.


class CheckpointCache:
    """The newest state of each glider of which many files are at hand, in memory alone.

    Of a long list most checkpoints would be thinned out before anyone goes on from them. So they are not
    written; what is lost of them when the daemon ends is remade from the checkpoint before and the segments.
    """

    def __init__(self) -> None:
        self._states: dict[str, tuple[SegmentId, GliderState]] = {}
        self._unsure: set[str] = set()

    def keep(self, identity: SegmentId, state: GliderState) -> None:
        """Keep the state after a segment, the newest of its glider."""
        self._states[identity.glider] = identity, state
        self._unsure.add(identity.glider)

    def before(self, first: SegmentId) -> tuple[SegmentId, GliderState] | None:
        """The state kept of its glider, if it is of a segment before `first`."""
        kept = self._states.get(first.glider)
        return kept if kept is not None and kept[0] < first else None

    def of(self, identity: SegmentId) -> GliderState | None:
        """The state after a segment, if that is the one kept of its glider."""
        kept = self._states.get(identity.glider)
        return kept[1] if kept is not None and kept[0] == identity else None

    def drop(self, glider: str) -> None:
        """Know no state of a glider."""
        self._states.pop(glider, None)

    def commit(self) -> None:
        """What was kept since the last time is in the state file."""
        self._unsure.clear()

    def rollback(self) -> None:
        """It is not: forget it."""
        for glider in self._unsure:
            self.drop(glider)
        self._unsure.clear()


# ----------------------------------------
# The segments of each glider in a state file, and the checkpoints after them.

RECENT = 8
"""Newest segments of a glider that all keep their checkpoint: before them comes most of what comes late."""
LATELY, CLOSE = 64, 4
"""Of so many newest one in so many does."""
IN_MEMORY = 64
"""Gliders of which the newest state is also kept in memory, some 0.1 MB each: to read it takes as long as to
assess a dive."""
SPARSE = 16
"""Of the older ones one in this many does. Its name decides, so that no order of arrival matters."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Segments that are to be processed upon the state after ``base`` (None: upon that of a glider of which
    nothing is known), in order of time. ``revision`` counts the transactions that changed what is held of
    the glider: two plans that are equal lead to equal outcomes."""

    base: SegmentId | None
    segments: tuple[SegmentId, ...]
    revision: int

    def is_as(self, other: Plan) -> bool:
        """Whether the outcomes of the other plan are those of this one."""
        return self.revision == other.revision and self == other


class Segments:
    """The segments in a state file, on the connection of its store.

    ``following`` counts the files of the glider that are at hand behind the one that is processed; ``ahead``
    has the states that are not written for it, ``clocks`` the clocks of missions.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._db = connection
        self.ahead, self.following = CheckpointCache(), 0
        self._latest: dict[str, tuple[SegmentId, GliderState]] = {}
        """Of some gliders the state after their newest segment, as its checkpoint has it."""
        self.clocks = MissionClocks(connection)
        self._revisions: dict[str, int] = {}
        self._changed: set[str] = set()

    def commit(self) -> None:
        """What was written since the last time is in the state file."""
        self.ahead.commit()
        self.clocks.commit()
        for glider in self._changed:
            self._revisions[glider] = self._revisions.get(glider, 0) + 1
        self._changed.clear()

    def rollback(self) -> None:
        """It is not."""
        self.ahead.rollback()
        self.clocks.rollback()
        for glider in self._changed:
            self._latest.pop(glider, None)
        self._changed.clear()

    def changed(self, glider: str) -> None:
        """What was planned of a glider before this transaction holds no more."""
        self._changed.add(glider)

    def completeness(self, identity: SegmentId) -> tuple[int, int, str] | None:
        """Of the copy of a segment that is held, None when there is none; by the glider's clock."""
        row = self._held(identity)
        return codec.plain_decode(row["completeness"], tuple[int, int, str]) if row is not None else None

    def is_fuller(self, segment: Segment) -> bool:
        """Whether a copy of a segment holds more than the one that is held, or none is."""
        held = self.completeness(segment.id)
        return held is None or held < segment.completeness

    def offset(self, identity: SegmentId) -> float:
        """What is to be added to the glider's clock (s) in a segment that is held."""
        row = self._held(identity)
        return 0.0 if row is None else float(row["clock_offset"])

    def is_held(self, glider: str, name: str) -> bool:
        """Whether any segment of this name is held."""
        sql = "SELECT EXISTS (SELECT 1 FROM segments WHERE glider = ? AND name = ?)"
        return bool(self._db.execute(sql, (glider, name)).fetchone()[0])

    def _held(self, identity: SegmentId) -> sqlite3.Row | None:
        """The row of a segment by the glider's clock: the files of one segment open within seconds."""
        row: sqlite3.Row | None = self._db.execute(
            "SELECT opened_at, completeness, clock_offset, clock_step FROM segments "
            "WHERE glider = ?1 AND name = ?2 AND abs(opened_at - clock_offset - ?3) <= ?4 "
            "ORDER BY abs(opened_at - clock_offset - ?3) LIMIT 1",
            (identity.glider, identity.name, identity.opened_at, SAME_OPENING),
        ).fetchone()
        return row

    def place(self, segment: Segment) -> tuple[SegmentId, float]:
        """Keep a segment (`put`); the first one that this touches, and what to add to its times (s)."""
        return self.put(segment), self.offset(segment.id)

    def put(self, segment: Segment) -> SegmentId:
        """Keep a segment in place of an earlier copy; the first id in time that this touches.

        Its times are by the glider's clock. Where that was set back the segment, and others of its mission
        of which that is only now seen, get the ids that they have in the right time.
        What navigation would average anyway is kept as that: 4 s data would fill the state file.
        """
        thinned = replace(segment, quantities=downsample(segment.quantities))
        glider, name = segment.id.glider, segment.id.name
        self._changed.add(glider)
        old, touched, correction = self._held(segment.id), list[SegmentId](), Correction()
        if old is not None:
            touched = [SegmentId(old["opened_at"], glider, name)]
            correction = Correction(old["clock_offset"], old["clock_step"])
            self._forget(touched[0])
            self.clocks.clear()
        self._db.execute(
            "INSERT INTO segments VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, NULL)",
            (
                glider,
                segment.id.opened_at + correction.offset,
                name,
                codec.plain_encode(segment.completeness),
                _is_one_in(SPARSE, name),
                segment.last_t,
                correction.offset,
                correction.step,
                codec.encode(thinned),
            ),
        )
        moves = self.clocks.correct(segment.id, segment.last_t)
        here = SegmentId(segment.id.opened_at + correction.offset, glider, name)
        return min([moves.pop(here, here), *touched, *moves, *moves.values()])

    def _forget(self, identity: SegmentId) -> None:
        key = (identity.glider, identity.opened_at, identity.name)
        self._db.execute("DELETE FROM segments WHERE glider = ? AND opened_at = ? AND name = ?", key)
        for table in ("expected", "layers"):
            self._db.execute(f"DELETE FROM {table} WHERE glider = ? AND opened_at = ? AND segment = ?", key)

    def plan(self, first: SegmentId) -> Plan:
        """What is to be processed where a segment or more from `first` on are new: all after the newest state
        before it."""
        glider, base = first.glider, self._base(first)
        after = self.of(glider) if base is None else self._after(glider, base.opened_at, base.name)
        return Plan(base, tuple(after), self._revisions.get(glider, 0))

    def plan_after(self, identity: SegmentId) -> Plan | None:
        """The same for one that is still to be put, by the glider's clock, as far as can be foreseen; None
        where it does not come after all that are held."""
        here = replace(identity, opened_at=identity.opened_at + self.clocks.offset(identity))
        newest = self.last_before(identity.glider, float("inf"))
        if newest is not None and (newest >= here or self._held(identity) is not None):
            return None
        plan = self.plan(here)
        return replace(plan, segments=(*plan.segments, here))

    def _base(self, first: SegmentId) -> SegmentId | None:
        """The newest segment before another that has its state."""
        ahead = self.ahead.before(first)
        if ahead is not None:
            return ahead[0]
        self.ahead.drop(first.glider)
        row = self._db.execute(
            "SELECT opened_at, name FROM segments WHERE glider = ? AND checkpoint IS NOT NULL "
            "AND (opened_at, name) < (?, ?) ORDER BY opened_at DESC, name DESC LIMIT 1",
            (first.glider, first.opened_at, first.name),
        ).fetchone()
        return None if row is None else SegmentId(row[0], first.glider, row[1])

    def state(self, identity: SegmentId | None) -> GliderState:
        """The state after a segment that has it; None: of a glider of which nothing is known."""
        if identity is None:
            return GliderState()
        if (ahead := self.ahead.of(identity)) is not None:
            return ahead
        if (latest := self._in_memory(identity)) is not None:
            return latest
        data = self._checkpoint(identity)
        if data is None:
            raise KeyError(identity.name)
        return codec.decode(data, GliderState)

    def resume(self, first: SegmentId) -> tuple[GliderState, list[SegmentId]]:
        """The newest state before a segment, and the ids of all segments after it, in order of time."""
        plan = self.plan(first)
        return self.state(plan.base), list(plan.segments)

    def of(self, glider: str) -> list[SegmentId]:
        """The ids of all segments of a glider, in order of time."""
        return self._after(glider, float("-inf"), "")

    def _after(self, glider: str, opened_at: float, name: str) -> list[SegmentId]:
        rows = self._db.execute(
            "SELECT opened_at, name FROM segments WHERE glider = ? AND (opened_at, name) > (?, ?) "
            "ORDER BY opened_at, name",
            (glider, opened_at, name),
        )
        return [SegmentId(row[0], glider, row[1]) for row in rows]

    def last_before(self, glider: str, t: float) -> SegmentId | None:
        """The last segment that opened before a time (s)."""
        row = self._db.execute(
            "SELECT opened_at, name FROM segments WHERE glider = ? AND opened_at < ? "
            "ORDER BY opened_at DESC, name DESC LIMIT 1",
            (glider, t),
        ).fetchone()
        return None if row is None else SegmentId(row[0], glider, row[1])

    def outdate(self, first: SegmentId) -> None:
        """Forget the states after a segment and all later ones: they are to be processed again (`behind`).

        What `state.keep_days` has left of before stays: it can not be made again.
        """
        self._db.execute(
            "UPDATE segments SET checkpoint = NULL WHERE glider = ? AND (opened_at, name) >= (?, ?) "
            f"AND milestone != {FIRST}",
            (first.glider, first.opened_at, first.name),
        )
        self.ahead.drop(first.glider)
        self._latest.pop(first.glider, None)
        self._changed.add(first.glider)

    def behind(self, glider: str) -> SegmentId | None:
        """The newest segment of a glider, if the state after it is outdated."""
        row = self._db.execute(  # the state itself, some 50 kB, is not read
            "SELECT opened_at, name, checkpoint IS NULL FROM segments WHERE glider = ? "
            "ORDER BY opened_at DESC, name DESC LIMIT 1",
            (glider,),
        ).fetchone()
        if row is None or not row[2]:
            return None
        newest = SegmentId(row[0], glider, row[1])
        return newest if self.ahead.of(newest) is None else None

    def newest(self, glider: str) -> GliderState | None:
        """The state after the newest segment of a glider; None where there is none, or it is outdated."""
        newest = self.last_before(glider, float("inf"))
        if newest is None:
            return None
        if (state := self.ahead.of(newest) or self._in_memory(newest)) is not None:
            return state
        data = self._checkpoint(newest)
        return None if data is None else codec.decode(data, GliderState)

    def _in_memory(self, identity: SegmentId) -> GliderState | None:
        """The state after a segment, where it is in memory and the state file still has it."""
        held = self._latest.get(identity.glider)
        if held is None or held[0] != identity:
            return None
        row = self._db.execute(  # the record itself is not read
            "SELECT checkpoint IS NULL FROM segments WHERE glider = ? AND opened_at = ? AND name = ?",
            (identity.glider, identity.opened_at, identity.name),
        ).fetchone()
        return None if row is None or row[0] else held[1]

    def _checkpoint(self, identity: SegmentId) -> bytes | None:
        data: bytes | None = self._db.execute(
            "SELECT checkpoint FROM segments WHERE glider = ? AND opened_at = ? AND name = ?",
            (identity.glider, identity.opened_at, identity.name),
        ).fetchone()[0]
        return data

    def get(self, identity: SegmentId) -> Segment:
        """A segment that is held, in its right time."""
        row = self._row(identity)
        return moved(codec.decode(row["segment"], Segment), row["clock_offset"])

    def kept(self, identity: SegmentId) -> Segment:
        """The copy that is held of a segment by the glider's clock, in its right time."""
        row = self._held(identity)
        if row is None:
            raise KeyError(identity.name)
        return self.get(SegmentId(row["opened_at"], identity.glider, identity.name))

    def as_sent(self, identity: SegmentId) -> Segment:
        """The same in the time of the glider's clock."""
        return codec.decode(self._row(identity)["segment"], Segment)

    def _row(self, identity: SegmentId) -> sqlite3.Row:
        row: sqlite3.Row = self._db.execute(
            "SELECT segment, clock_offset FROM segments WHERE glider = ? AND opened_at = ? AND name = ?",
            (identity.glider, identity.opened_at, identity.name),
        ).fetchone()
        return row

    def is_kept(self, name: str, behind: int) -> bool:
        """Whether the state after a segment is written where so many files are at hand behind it."""
        return behind < RECENT or (behind < LATELY and _is_one_in(CLOSE, name)) or _is_one_in(SPARSE, name)

    def checkpoint(
        self, identity: SegmentId, state: GliderState | bytes | None, expected: NextSurfacing | None
    ) -> None:
        """Keep the state after a segment (or its record as it is, or nothing: then more of its run follow),
        and the surfacing that it leads to expect."""
        self._changed.add(identity.glider)
        key = (identity.glider, identity.opened_at, identity.name)
        record = state if isinstance(state, bytes) else None
        if isinstance(state, GliderState):
            self._latest.pop(identity.glider, None)
            if self.following:
                self.ahead.keep(identity, state)
            else:
                self.ahead.drop(identity.glider)
                self._latest[identity.glider] = identity, state
                if len(self._latest) > IN_MEMORY:
                    self._latest.pop(next(iter(self._latest)))
            record = codec.encode_state(state) if self.is_kept(identity.name, self.following) else None
        self._db.execute(
            "UPDATE segments SET checkpoint = ?1 WHERE glider = ?2 AND opened_at = ?3 AND name = ?4 "
            "AND (?1 IS NOT NULL OR checkpoint IS NOT NULL)",
            (record, *key),
        )
        self._db.execute("DELETE FROM expected WHERE glider = ? AND opened_at = ? AND segment = ?", key)
        if expected is not None:
            row = (identity.glider, identity.name, identity.opened_at, expected.after)
            data = codec.plain_encode(expected)
            self._db.execute("INSERT INTO expected VALUES (?, ?, ?, ?, ?)", (*row, data))

    def last_surfacing(self, glider: str) -> float:
        """The last surfacing (s) that the expected one rests upon, by its files; -inf before any."""
        sql = "SELECT max(after) FROM expected WHERE glider = ? AND segment != ''"
        found: float | None = self._db.execute(sql, (glider,)).fetchone()[0]
        return float("-inf") if found is None else found

    def expect_after_call(self, glider: str, expected: NextSurfacing | None) -> None:
        """Keep the surfacing that the last call leads to expect, where its file is still to come."""
        self._db.execute("DELETE FROM expected WHERE glider = ? AND segment = ''", (glider,))
        if expected is not None:
            row = (glider, "", expected.after, expected.after, codec.plain_encode(expected))
            self._db.execute("INSERT INTO expected VALUES (?, ?, ?, ?, ?)", row)

    def thin(self, first: SegmentId) -> None:
        """Let go of checkpoints that are not `is_kept`, after a segment and all later ones were processed.

        What is further back was thinned before, so that a long mission costs no more than a short one.
        """
        glider = first.glider
        newest = "SELECT opened_at, name FROM segments WHERE glider = ?1 ORDER BY opened_at DESC, name DESC"
        since = self._db.execute(f"{newest} LIMIT 1 OFFSET ?2", (glider, 2 * LATELY)).fetchone()
        lately = self._db.execute(f"{newest} LIMIT 1 OFFSET ?2", (glider, LATELY - 1)).fetchone()
        rows = self._db.execute(  # of the index alone: `milestone` lies behind the long records of its row
            "SELECT opened_at, name FROM segments WHERE glider = ?1 AND checkpoint IS NOT NULL "
            f"AND (opened_at, name) < ({newest} LIMIT 1 OFFSET ?2) AND opened_at >= ?3",
            (glider, RECENT - 1, float("-inf") if since is None else min(since[0], first.opened_at)),
        ).fetchall()
        self._db.executemany(
            f"UPDATE segments SET checkpoint = NULL WHERE glider = ? AND opened_at = ? AND name = ? "
            f"AND milestone != {FIRST}",
            [
                (glider, *row)
                for row in map(tuple, rows)
                if not _is_one_in(SPARSE, row[1])
                and not (_is_one_in(CLOSE, row[1]) and (lately is None or row >= tuple(lately)))
            ],
        )


def _is_one_in(n: int, name: str) -> bool:
    """Whether a segment is the one in ``n`` that keeps its checkpoint."""
    return zlib.crc32(name.encode()) % n == 0
