-- Schema 1 of the state file. A later schema is a migration in `database.py`, never an edit of this file.
-- Times are seconds since 1970-01-01T00:00:00Z. Records (state, segment): `codec.py`.

CREATE TABLE files (              -- the ledger: every file seen, by path
    path     TEXT PRIMARY KEY,
    size     INTEGER NOT NULL,
    mtime_ns INTEGER NOT NULL,
    status   TEXT NOT NULL CHECK (status IN ('taken', 'duplicate', 'waiting', 'quarantined', 'unknown')),
    glider   TEXT NOT NULL,       -- from the header; empty where it could not be read
    segment  TEXT NOT NULL,
    reason   TEXT NOT NULL,       -- in words
    crc      TEXT NOT NULL,       -- of the cache file that is waited for
    noted_at REAL NOT NULL
) STRICT;
CREATE INDEX files_by_status ON files (status);

CREATE TABLE segments (           -- what was decoded, and the state of the glider after it
    glider       TEXT NOT NULL,
    opened_at    REAL NOT NULL,
    name         TEXT NOT NULL,
    completeness TEXT NOT NULL,
    segment      BLOB NOT NULL,
    checkpoint   BLOB,            -- NULL where thinned out: the next older one is gone on from
    milestone    INTEGER NOT NULL, -- 1 where the checkpoint is kept for good
    PRIMARY KEY (glider, name)
) STRICT;
CREATE UNIQUE INDEX segments_in_order ON segments (glider, opened_at, name);
CREATE INDEX segments_to_resume_from ON segments (glider, opened_at, name) WHERE checkpoint IS NOT NULL;

CREATE TABLE assessments (
    glider    TEXT NOT NULL,
    t_dive    REAL NOT NULL,
    t_surface REAL NOT NULL,
    ended     INTEGER NOT NULL,   -- 0 while the fix that ends the dive has not come
    flag      INTEGER,
    data      TEXT NOT NULL,
    PRIMARY KEY (glider, t_dive)
) STRICT;
CREATE INDEX assessments_by_surfacing ON assessments (glider, ended, t_surface);

CREATE TABLE incidents (
    id         TEXT PRIMARY KEY,
    glider     TEXT NOT NULL,
    opened_at  REAL NOT NULL,
    cleared_at REAL,
    data       TEXT NOT NULL
) STRICT;
CREATE INDEX incidents_by_glider ON incidents (glider, opened_at);

CREATE TABLE said (               -- what people have been told of a glider
    glider TEXT PRIMARY KEY,
    data   TEXT NOT NULL
) STRICT;

CREATE TABLE alerts (             -- every message ever made
    id      TEXT PRIMARY KEY,
    glider  TEXT NOT NULL,
    time    REAL NOT NULL,
    made_at REAL NOT NULL,
    data    TEXT NOT NULL
) STRICT;

CREATE TABLE outbox (             -- one row per message and channel
    id           INTEGER PRIMARY KEY,
    alert        TEXT NOT NULL REFERENCES alerts (id),
    channel      TEXT NOT NULL,
    incident     TEXT NOT NULL,
    attempts     INTEGER NOT NULL DEFAULT 0,
    next_try     REAL NOT NULL DEFAULT 0,
    delivered_at REAL,
    error        TEXT NOT NULL DEFAULT '',
    UNIQUE (alert, channel)
) STRICT;
CREATE INDEX outbox_undelivered ON outbox (channel, incident, id) WHERE delivered_at IS NULL;
