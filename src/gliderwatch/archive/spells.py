"""Spells of flagged dives, and what the glider measured around them: the ground truth of paper 000 (Figs. 3,
8, 17)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gliderwatch.archive.onset import Onset, onset
from gliderwatch.errors import GliderwatchError
from gliderwatch.model import Assessment, Flag, Incident, Segment, Series, readonly
from gliderwatch.slocum.decode import Decoder
from gliderwatch.slocum.header import read_header

DAY = 86400.0
BESIDE = DAY
"""s: so much is shown before the first flag of a spell, and after it; flags that are nearer are one spell."""
MOST = 8
"""Spells of a mission that are shown: a glider that is flagged more often is shown whole by other figures."""
BINS = 1000
"""Parts of a spell, of each of which the least and the greatest value is drawn: a strike lasts a minute."""
QUANTITIES = {
    "roll": ("roll",),
    "pitch": ("pitch",),
    "heading": ("heading",),
    "ballast": ("ballast", "oil_volume"),
    "depth": ("depth",),
}
"""What is shown, and the quantities of a segment that it is: of several the one with most samples."""


@dataclass(frozen=True, slots=True)
class Spell:
    """Dives with a ``flag`` in a row, ``since`` (s) the first one began; ``samples`` (SI) by the names of
    `QUANTITIES`, as the glider measured them from a day before to a day after; when they show that it began
    (None: they show no step)."""

    since: float
    flag: Flag
    samples: Mapping[str, Series]
    onset: Onset | None


def spells(
    dives: Sequence[Assessment],
    incidents: Iterable[Incident],
    files: Iterable[Path],
    caches: Sequence[Path],
    decoder: Decoder,
) -> tuple[Spell, ...]:
    """The spells of a mission with what its `files` hold around each, whose lists are in `caches`.

    They are read again, as what was judged keeps a sample in half a minute.
    """
    firsts = first_dives(dives, {one.since: one.opened_at for one in incidents})
    if not firsts:
        return ()
    opened = sorted(_opened(files, firsts[0][0].glider))
    decoder.cache_folders, decoder.science = tuple(caches), None
    return tuple(_spell(*first, opened, decoder) for first in firsts)


def _opened(files: Iterable[Path], glider: str) -> Iterator[tuple[float, Path]]:
    """The files of a glider, each with the time (s) at which it was opened."""
    for path in files:
        with suppress(GliderwatchError):  # named by the replay, which says what is wrong with it
            header = read_header(path)
            if header.id.glider == glider:
                yield header.id.opened_at, path


def first_dives(dives: Sequence[Assessment], opened: Mapping[float, float]) -> list[tuple[Assessment, float]]:
    """The first dive of each incident and of each other spell of flags, `MOST` at the most and incidents
    first, with the surfacing (s) at which it was seen; `opened` are those of the incidents by the start of
    their first dive."""
    out, last = list[tuple[Assessment, float]](), -np.inf
    for dive in dives:
        if dive.flag not in (Flag.ANOMALY, Flag.FALSE_ALARM):
            continue
        before = out[-1][0].t_dive if out else -np.inf
        if dive.t_dive in opened and before not in opened and dive.t_dive - before < BESIDE:
            out.pop()  # the incident that follows shows the same hours
        if dive.t_dive - last > BESIDE or dive.t_dive in opened:
            out.append((dive, opened.get(dive.t_dive, dive.t_surface)))
        last = dive.t_dive
    shown = sorted(out, key=lambda one: one[0].t_dive not in opened)[:MOST]
    return sorted(shown, key=lambda one: one[0].t_dive)


def _spell(first: Assessment, until: float, opened: Sequence[tuple[float, Path]], decoder: Decoder) -> Spell:
    start, end = first.t_dive - BESIDE, max(first.t_dive + BESIDE, until)
    ends = [*(t for t, _ in opened[1:]), np.inf]
    near = [path for (t, path), after in zip(opened, ends, strict=True) if after > start and t < end]
    segments = [found for _, found in decoder.map(near) if isinstance(found, Segment)]
    found = {name: _most(segments, names).between(start, end) for name, names in QUANTITIES.items()}
    return Spell(
        first.t_dive,
        Flag(first.flag or 0),
        {name: thinned(each) for name, each in found.items() if len(each)},
        onset(found, until),
    )


def _most(segments: Sequence[Segment], names: Sequence[str]) -> Series:
    """Of some quantities the samples, in order of time, of the one with most."""
    found = [[segment.get(name) for segment in segments] for name in names]
    most = max(found, key=lambda each: sum(map(len, each)))
    t, v = (np.concatenate([np.empty(0), *(getattr(each, of) for each in most)]) for of in ("t", "v"))
    order = np.argsort(t, kind="stable")
    return Series(readonly(t[order]), readonly(v[order]))


def thinned(series: Series) -> Series:
    """Of each of `BINS` parts of the time at most the least and the greatest sample.

    >>> t = np.arange(100_000.0)
    >>> made = thinned(Series(t, np.where(t == 5000.0, 1.0, 0.0)))
    >>> len(made) <= 2 * BINS, float(made.v.max())
    (True, 1.0)
    """
    t, v = series.t, series.v
    if len(t) <= 2 * BINS:
        return series
    edges = np.searchsorted(t, np.linspace(t[0], t[-1], BINS + 1)[1:-1])
    parts = [part for part in np.split(np.arange(len(t)), edges) if len(part)]
    kept = sorted({int(part[f(v[part])]) for part in parts for f in (np.argmin, np.argmax)})
    return Series(readonly(t[kept]), readonly(v[kept]))
