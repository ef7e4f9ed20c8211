"""One mission judged again: by its full files as what could be known, and by what was sent as if online."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing.util import Finalize
from pathlib import Path

import msgspec
import numpy as np

from gliderwatch.archive.along import Along, along
from gliderwatch.archive.delayed import losses, mean_currents
from gliderwatch.archive.difference import Difference, Found, compare
from gliderwatch.archive.missions import Mission, is_full
from gliderwatch.archive.spells import Spell, spells
from gliderwatch.config import load
from gliderwatch.errors import GliderwatchError
from gliderwatch.model import Array, Assessment, Dive, Incident, SegmentId
from gliderwatch.params import GliderParams
from gliderwatch.score.graft import navigate
from gliderwatch.score.grid import configured, settings_of
from gliderwatch.score.work import version
from gliderwatch.sea.gauss_markov import FlowParams
from gliderwatch.sea.smoother import Delayed, MeanCurrent, smooth
from gliderwatch.service.replay import Request, cache_folders, caches_in, replay
from gliderwatch.service.transaction import FileOutcome
from gliderwatch.slocum.decode import Decoder
from gliderwatch.slocum.folders import is_cache

MONTH = 30 * 86400.0
ASKED = 10.0
"""s from the last sample of a segment to the first byte of its file, in a call that was seen."""
RATE = 100.0
"""Bytes a second by Iridium, as a glider itself reckons: "1800 secs, representing 180 KB"."""


@dataclass(frozen=True, slots=True)
class Judged:
    """A mission judged by one kind of its files.

    ``dives`` of which ``flags`` counts each flag (`none`: not judged), between ``start`` and ``end`` (s);
    medians of ``speed`` and of the ``current`` (m/s).
    """

    dives: int
    flags: dict[str, int]
    start: float
    end: float
    speed: float | None
    current: float | None
    incidents: tuple[Found, ...]

    @property
    def months(self) -> float:
        """How long it flew, in months of 30 days."""
        return (self.end - self.start) / MONTH


@dataclass(frozen=True, slots=True)
class Sea:
    """Where a mission flew: mean place (degrees), median of the greatest ``depth`` of its dives (m), root
    mean square of the ``tide`` and of the ``residual`` in delayed mode (m/s); None where it is not known."""

    lat: float | None
    lon: float | None
    depth: float | None
    tide: float | None
    residual: float | None


@dataclass(frozen=True, slots=True)
class Hindcast:
    """What came of a mission: by files as sent (``online``), by full ones (``full``), their ``difference``,
    its ``sea``.

    ``near_real_time`` and ``delayed`` are medians of the standard error of the instantaneous current (m/s).
    """

    name: str
    glider: str
    estimator: str
    online: Judged | None
    full: Judged | None
    difference: Difference | None
    sea: Sea
    near_real_time: float | None
    delayed: float | None


@dataclass(frozen=True, slots=True)
class Replayed:
    """A mission by one kind of its files: its ``assessments``, its ``dives``, what they come to, the places
    (degrees, (n, 2)) of the basis functions of the papers' law, and that law ``along`` the track (None:
    another estimator)."""

    assessments: tuple[Assessment, ...]
    dives: tuple[Dive, ...]
    judged: Judged
    centres: Array
    along: Along | None


@dataclass(frozen=True, slots=True)
class Evidence:
    """What a report draws: what the replays by each kind of files left, the currents in delayed mode, those
    measured, the ``width`` (m) of a basis function, and what was measured around the flags.
    """

    online: Replayed | None
    full: Replayed | None
    delayed: Delayed | None
    measured: tuple[MeanCurrent, ...]
    width: float
    spells: tuple[Spell, ...]

    @property
    def best(self) -> Replayed:
        """By full files where they are there, else as sent."""
        best = self.full or self.online
        assert best is not None
        return best


@dataclass(frozen=True, slots=True)
class Replays:
    """What the replays of a mission left, by each kind of files; the width (m) of a basis function, what was
    measured around the flags by the fullest files, the estimator."""

    online: Replayed | None
    full: Replayed | None
    width: float
    spells: tuple[Spell, ...]
    estimator: str


@cache
def _decoder() -> Decoder:
    """The decoder of this process, for all missions that it works on: to start one takes half a second."""
    made = Decoder(())
    Finalize(None, made.close, exitpriority=10)
    return made


def replays(
    mission: Mission, folder: Path, files: Sequence[Path], out: Path, estimator: str, settings: Path | None
) -> Replays:
    """Replay the `files` of a mission, which lie below `folder`, leaving the results of each replay in `out`.

    `estimator` is `joint`, `adaptive`, or `adaptive:PRESET`; where `settings` names a configuration, what it
    says of the glider counts instead.
    """
    config = configured(mission.glider, settings_of(estimator)) if settings is None else load(settings)
    params = config.glider(mission.glider)
    caches = sorted({path.parent for path in folder.rglob("*") if is_cache(path.name)})
    caches += caches_in(folder.resolve().parent)
    made, around = dict[str, Replayed](), tuple[Spell, ...]()
    for kind, wanted in (("online", False), ("full", True)):
        chosen = tuple(path for path in files if is_full(path) is wanted)
        if not chosen:
            continue
        request = Request(chosen, tuple(caches), config, mission.glider, out / kind)
        one, incidents = _replayed(request, mission.glider, params)
        if wanted or not mission.full:
            around = spells(one.assessments, incidents, chosen, cache_folders(request), _decoder())
        made[kind] = with_onsets(one, around) if wanted else one
    used = estimator if settings is None else params.estimator
    return Replays(made.get("online"), made.get("full"), params.learner.sigma, around, used)


def _replayed(request: Request, glider: str, params: GliderParams) -> tuple[Replayed, tuple[Incident, ...]]:
    """A mission by the files of a request, and its incidents."""
    reports = dict[str, FileOutcome]()

    def on_file(outcome: FileOutcome) -> None:
        for alert in outcome.alerts:
            reports.setdefault(alert.incident, outcome)

    report = replay(request, on_file=on_file, decoder=_decoder())
    store = report.store
    segments = [store.segments.get(identity) for identity in store.segments.of(glider)]
    assessments, incidents = tuple(store.assessments(glider)), tuple(store.incidents(glider))
    ends = {segment.id.name: segment.last_t for segment in segments}
    newest, _ = store.segments.resume(SegmentId(float("inf"), glider, ""))
    store.close()
    dives = tuple(navigate(segments))
    law = along(dives, params) if params.estimator == "adaptive" else None
    found = tuple(_found(one, law, _on_shore(reports.get(one.id), ends)) for one in incidents)
    centres = newest.memory.estimate.learner.centres
    return Replayed(assessments, dives, judge(assessments, found), centres, law), incidents


def _found(incident: Incident, law: Along | None, on_shore: float | None) -> Found:
    out = None if law is None else law.since_out(incident.opened_at)
    return Found(
        incident.kind.value, incident.since, incident.opened_at, incident.cleared_at, on_shore, out, None
    )


def _on_shore(report: FileOutcome | None, ends: Mapping[str, float]) -> float | None:
    """When the file was on shore (s) that made it known: after the call in which it was sent."""
    if report is None or report.file.segment not in ends:
        return None
    return ends[report.file.segment] + ASKED + report.file.size / RATE


def with_onsets(one: Replayed, around: Iterable[Spell]) -> Replayed:
    """Full files: with the onset of each incident by the samples around it. They came to shore later."""
    onsets = {spell.since: spell.onset for spell in around}
    incidents = tuple(
        replace(found, onset=onsets.get(found.since), on_shore=None) for found in one.judged.incidents
    )
    return replace(one, judged=replace(one.judged, incidents=incidents))


def hindcast(mission: Mission, made: Replays) -> tuple[Hindcast, Evidence]:
    """What the replays of a mission come to. Raises GliderwatchError where nothing could be judged."""
    best = made.full if made.full is not None and made.full.assessments else made.online
    if best is None or not best.assessments:
        raise GliderwatchError(
            f"{mission.place}: no dive of {mission.glider} could be judged: see why by "
            f"gliderwatch run --replay {mission.place}"
        )
    measured = mean_currents(best.dives, losses(best.assessments))
    delayed = smooth(measured, FlowParams()) if len(measured) > 1 else None
    found = Hindcast(
        mission.name,
        mission.glider,
        made.estimator,
        None if made.online is None else made.online.judged,
        None if made.full is None else made.full.judged,
        None if made.full is None or made.online is None else _difference(made.full, made.online),
        _sea(best.assessments, delayed),
        None if delayed is None else float(np.median(delayed.near_real_time.sigma)),
        None if delayed is None else float(np.median(delayed.delayed.sigma)),
    )
    full = made.full if best is made.full else None
    return found, Evidence(made.online, full, delayed, tuple(measured), made.width, made.spells)


def _sea(dives: Sequence[Assessment], delayed: Delayed | None) -> Sea:
    places = np.array([(d.lat, d.lon) for d in dives if d.lat is not None and d.lon is not None])
    depths = [d.evidence["depth_max"] for d in dives if "depth_max" in d.evidence]
    currents = None if delayed is None else delayed.delayed
    lat, lon = map(float, places.mean(axis=0)) if len(places) else (None, None)
    return Sea(
        lat,
        lon,
        float(np.median(depths)) if depths else None,
        None if currents is None else _size(currents.tide),
        None if currents is None else _size(currents.residual),
    )


def _size(flow: Array) -> float:
    """Root mean square of the speed of a flow ((n, 2), m/s)."""
    return float(np.sqrt(np.mean(np.sum(flow**2, axis=1))))


def _difference(full: Replayed, online: Replayed) -> Difference:
    return compare(full.assessments, online.assessments, full.judged.incidents, online.judged.incidents)


def judge(dives: Sequence[Assessment], incidents: tuple[Found, ...]) -> Judged:
    """The dives of a mission, counted."""
    flags = Counter("none" if dive.flag is None else str(dive.flag) for dive in dives)
    speeds = [dive.speed for dive in dives if dive.speed is not None]
    flows = [np.hypot(d.flow_u, d.flow_v) for d in dives if d.flow_u is not None and d.flow_v is not None]
    return Judged(
        len(dives),
        dict(sorted(flags.items())),
        dives[0].t_dive if dives else 0.0,
        dives[-1].t_surface if dives else 0.0,
        float(np.median(speeds)) if speeds else None,
        float(np.median(flows)) if flows else None,
        incidents,
    )


def fingerprint(mission: Mission, files: Iterable[Path], estimator: str, chosen: str) -> str:
    """A short hash of all that a hindcast rests on: files with their sizes, settings (`chosen` is the text of
    a configuration), the sources."""
    listed = [f"{path.name} {path.stat().st_size}" for path in files]
    parts = [version(), repr(mission), estimator, chosen, *sorted(listed)]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]


def read(path: Path) -> Hindcast | None:
    """A result that an earlier run left; None where there is none that can be read."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Hindcast)
    except (OSError, msgspec.DecodeError):
        return None
