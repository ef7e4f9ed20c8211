"""One mission judged again: by its full files as what could be known, and by what was sent as if online."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

from gliderwatch.archive.delayed import losses, mean_currents
from gliderwatch.archive.missions import Mission, is_full
from gliderwatch.archive.spells import Spell, spells
from gliderwatch.config import load
from gliderwatch.errors import GliderwatchError
from gliderwatch.model import Array, Assessment, Dive, Incident, SegmentId, readonly
from gliderwatch.score.graft import navigate
from gliderwatch.score.grid import configured, settings_of
from gliderwatch.score.work import version
from gliderwatch.sea.gauss_markov import FlowParams
from gliderwatch.sea.smoother import Delayed, MeanCurrent, smooth
from gliderwatch.service.replay import Request, cache_folders, caches_in, replay
from gliderwatch.slocum.folders import is_cache

MONTH = 30 * 86400.0
SAME = 600.0
"""s: dives of full files and of files as sent that begin so near to each other are one dive."""


@dataclass(frozen=True, slots=True)
class Found:
    """An incident: its ``kind``, ``since`` (s, the first dive in it), ``opened_at`` (s, the surfacing at
    which a pilot would have known) and ``cleared_at`` (s, None: open at the end)."""

    kind: str
    since: float
    opened_at: float
    cleared_at: float | None


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
class Difference:
    """What full files show otherwise than those that were sent: ``dives`` that both have, root mean square of
    the difference of ``speed`` and of a component of the ``current`` (m/s, None: no dive has both), and how
    much later (h) each incident of the full files was opened by those sent (None: never)."""

    dives: int
    speed: float | None
    current: float | None
    delays: tuple[tuple[str, float | None], ...]


@dataclass(frozen=True, slots=True)
class Hindcast:
    """What came of a mission: by files as sent (``online``), by full ones (``full``), their ``difference``.

    ``near_real_time`` and ``delayed`` are medians of the standard error of the instantaneous current (m/s).
    """

    name: str
    glider: str
    estimator: str
    online: Judged | None
    full: Judged | None
    difference: Difference | None
    near_real_time: float | None
    delayed: float | None


@dataclass(frozen=True, slots=True)
class Evidence:
    """What a report draws: assessments by each kind of files, the currents in delayed mode, those measured,
    the ``dives`` that they are of, the places (degrees, (n, 2)) of the basis functions of the papers' law
    with their ``width`` (m), and what was measured around the flags.
    """

    online: tuple[Assessment, ...]
    full: tuple[Assessment, ...]
    delayed: Delayed | None
    measured: tuple[MeanCurrent, ...]
    dives: tuple[Dive, ...]
    centres: Array
    width: float
    spells: tuple[Spell, ...]

    @property
    def best(self) -> tuple[Assessment, ...]:
        """By full files where they are there, else as sent."""
        return self.full or self.online


@dataclass(frozen=True, slots=True)
class Replays:
    """What the replays of a mission left: by kind of files (`online`, `full`) the assessments and what they
    come to, its ``dives``, the places of the basis functions (degrees, (n, 2)) and their width
    (m), what was measured around the flags by the fullest files, the estimator."""

    assessed: dict[str, tuple[Assessment, ...]]
    judged: dict[str, Judged]
    dives: list[Dive]
    centres: Array
    width: float
    spells: tuple[Spell, ...]
    estimator: str


def replays(
    mission: Mission, folder: Path, files: Sequence[Path], out: Path, estimator: str, settings: Path | None
) -> Replays:
    """Replay the `files` of a mission, which lie below `folder`, leaving the results of each replay in `out`.

    `estimator` is `joint`, `adaptive`, or `adaptive:PRESET`; where `settings` names a configuration, what it
    says of the glider counts instead.
    """
    assessed: dict[str, tuple[Assessment, ...]] = {"online": (), "full": ()}
    judged = dict[str, Judged]()
    dives, centres, around = list[Dive](), readonly(np.empty((0, 2))), tuple[Spell, ...]()
    config = configured(mission.glider, settings_of(estimator)) if settings is None else load(settings)
    caches = sorted({path.parent for path in folder.rglob("*") if is_cache(path.name)})
    caches += caches_in(folder.resolve().parent)
    for kind, wanted in (("online", False), ("full", True)):
        chosen = tuple(path for path in files if is_full(path) is wanted)
        if not chosen:
            continue
        request = Request(chosen, tuple(caches), config, mission.glider, out / kind)
        store = replay(request).store
        assessed[kind] = tuple(store.assessments(mission.glider))
        judged[kind] = judge(assessed[kind], store.incidents(mission.glider))
        segments = (store.segments.get(identity) for identity in store.segments.of(mission.glider))
        dives = navigate(segments) or dives
        newest, _ = store.segments.resume(SegmentId(float("inf"), mission.glider, ""))
        centres = newest.memory.estimate.learner.centres
        around = spells(assessed[kind], chosen, cache_folders(request))
        store.close()
    params = config.glider(mission.glider)
    used = estimator if settings is None else params.estimator
    return Replays(assessed, judged, dives, centres, params.learner.sigma, around, used)


def hindcast(mission: Mission, made: Replays) -> tuple[Hindcast, Evidence]:
    """What the replays of a mission come to. Raises GliderwatchError where nothing could be judged."""
    assessed, judged = made.assessed, made.judged
    measured = mean_currents(made.dives, losses(assessed["full"] or assessed["online"]))
    if not any(assessed.values()):
        raise GliderwatchError(
            f"{mission.place}: no dive of {mission.glider} could be judged: see why by "
            f"gliderwatch run --replay {mission.place}"
        )
    delayed = smooth(measured, FlowParams()) if len(measured) > 1 else None
    both = "online" in judged and "full" in judged
    found = Hindcast(
        mission.name,
        mission.glider,
        made.estimator,
        judged.get("online"),
        judged.get("full"),
        _difference(assessed, judged) if both else None,
        None if delayed is None else float(np.median(delayed.near_real_time.sigma)),
        None if delayed is None else float(np.median(delayed.delayed.sigma)),
    )
    online, full = assessed["online"], assessed["full"]
    dives = tuple(made.dives)
    return found, Evidence(
        online, full, delayed, tuple(measured), dives, made.centres, made.width, made.spells
    )


def judge(dives: Sequence[Assessment], incidents: Iterable[Incident]) -> Judged:
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
        tuple(Found(i.kind.value, i.since, i.opened_at, i.cleared_at) for i in incidents),
    )


def _difference(assessed: dict[str, tuple[Assessment, ...]], judged: dict[str, Judged]) -> Difference:
    pairs = same_dives(assessed["full"], assessed["online"])
    speed = [a.speed - b.speed for a, b in pairs if a.speed is not None and b.speed is not None]
    current = [
        x - y
        for a, b in pairs
        for x, y in ((a.flow_u, b.flow_u), (a.flow_v, b.flow_v))
        if x is not None and y is not None
    ]
    return Difference(
        len(pairs), _rms(speed), _rms(current), delays(judged["full"].incidents, judged["online"].incidents)
    )


def same_dives(
    some: Sequence[Assessment], others: Sequence[Assessment]
) -> list[tuple[Assessment, Assessment]]:
    """The dives that are in both, each with itself."""
    starts = np.array([dive.t_dive for dive in others])
    out = []
    for dive in some:
        if (
            len(starts)
            and abs(starts[i := int(np.argmin(np.abs(starts - dive.t_dive)))] - dive.t_dive) < SAME
        ):
            out.append((dive, others[i]))
    return out


def delays(full: Sequence[Found], online: Sequence[Found]) -> tuple[tuple[str, float | None], ...]:
    """Of each incident by full files its kind, and how much later (h) files as sent opened one of that kind
    which lasted at the same time; None: they did not."""

    def later(one: Found) -> float | None:
        same = [o for o in online if o.kind == one.kind and o.since <= _end(one) and _end(o) >= one.since]
        return min((o.opened_at - one.opened_at) / 3600 for o in same) if same else None

    return tuple((one.kind, later(one)) for one in full)


def _end(one: Found) -> float:
    return np.inf if one.cleared_at is None else one.cleared_at


def _rms(values: Sequence[float]) -> float | None:
    return float(np.sqrt(np.mean(np.square(values)))) if values else None


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
