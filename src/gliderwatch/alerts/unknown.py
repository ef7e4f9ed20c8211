"""What people read when no dive of a glider can be judged although files come, and when that ends. Pure."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

from gliderwatch.alerts.page import Page
from gliderwatch.alerts.words import clean, duration, utc
from gliderwatch.model import Alert, Hindrance, Kind, Severity, Unusable

_SHOWN = 4
"""Reasons that a message names, the most frequent first."""
_SBD_LIST = "the sbd list of the glider (sbdlist.dat)"
_FIX = f"add m_gps_lat and m_gps_lon to {_SBD_LIST} if they lack; else look at the GPS and its antenna"
_HEADING = f"add m_heading (or at least c_heading) to {_SBD_LIST}; if it is there, send it more often"
_AGAIN = "copy the files from the glider or the dockserver again; `gliderwatch status` names them"
CURES: dict[Unusable | Hindrance | None, str] = {
    Hindrance.NO_CACHE: "copy {cache} from the dockserver, or from the glider (its folder state/cache), to a "
    "folder of `dockserver.cache`; or take back the change of the sbd list. What waits is then taken",
    Hindrance.UNREADABLE: "look at the share and the rights of the files; they are tried again",
    Hindrance.DAMAGED: f"{_AGAIN}. Many at once: a damaged disk, or a transfer that cuts files",
    Hindrance.NOT_ASSESSED: "a fault of gliderwatch: please report it, with a file. The log says more",
    Unusable.NOT_SURFACED: _FIX,
    Unusable.NO_FIX_BEFORE: _FIX,
    Unusable.STALE_FIX: "the glider repeats an old fix: look at the GPS, let it stay longer at the surface",
    Unusable.WILD_FIX: "two gliders under one name, or a GPS that fails: look at the positions",
    Unusable.DATA_MISSING: "files do not come: look on the dockserver and send them from the glider again",
    Unusable.SURFACE_DRIFT: "does it dive? If so, add m_depth and m_pitch to " + _SBD_LIST,
    Unusable.NO_HEADING: _HEADING,
    Unusable.TURNING: _HEADING,
    None: f"`gliderwatch doctor` says which sensors are missing in {_SBD_LIST}",
}
"""What a pilot can do about each reason."""


@dataclass(frozen=True, slots=True)
class Unjudged:
    """What should have led to a judgement and did not: a dive without a flag, or a file that was not taken.

    ``start`` and ``end`` (s); ``cause`` for decisions (None: the estimator's own, as in ``words``) and in
    ``words``; ``crc`` of the cache file that is missing.
    """

    start: float
    end: float
    cause: Unusable | Hindrance | None
    words: str
    crc: str = ""

    @property
    def is_file(self) -> bool:
        """Whether it is a file that was not taken."""
        return isinstance(self.cause, Hindrance)


@dataclass(frozen=True, slots=True)
class Blindness:
    """Nothing of a glider could be judged from ``since`` to ``until`` (s).

    ``judged`` is the last surfacing (s) whose dive could be (None: none), ``items`` what could not, in order.
    """

    glider: str
    since: float
    until: float
    judged: float | None
    items: tuple[Unjudged, ...]


def blind(found: Blindness, *, alert_id: str, thread: str, first: bool) -> Alert:
    """No dive can be judged; not the ``first`` message of it: it still is so."""
    reasons = _reasons(found.items)
    (main, count), lasted = reasons[0], duration(found.until - found.since)
    lead = f"{'No' if first else 'Still no'} dive of {_name(found.glider)} could be judged for {lasted}, "
    lead += "although it is at sea and its files come. "
    lead += "A fault of the glider would not be seen."
    last = "none yet" if found.judged is None else f"surfaced {utc(found.judged)}"
    page = Page(
        (lead,),
        (
            ("Since", utc(found.since)),
            ("Last dive that could be judged", last),
            ("Main reason", f"{_counted(main, count)}: {clean(main.words, 300)}"),
        ),
        (
            ("What to do", tuple(dict.fromkeys(_cure(item) for item, _ in reasons))),
            *((("Other reasons", tuple(_reason(*reason) for reason in reasons[1:])),) if reasons[1:] else ()),
        ),
    )
    title = f"{'' if first else 'REMINDER '}CANNOT BE JUDGED {_name(found.glider)}: {lasted} without a "
    title += f"judgement, {clean(main.words, 80)}"
    kind = Kind.UNKNOWN if first else Kind.REMINDER
    return _alert(found.glider, found.until, kind, title, page, alert_id, thread, Severity.WARNING)


def judged(glider: str, since: float, at: float, *, alert_id: str, thread: str) -> Alert:
    """A dive that surfaced ``at`` a time (s) could be judged, the first after ``since`` (s)."""
    lead = f"Dives of {_name(glider)} can be judged again, after {duration(at - since)} without a judgement."
    page = Page((lead,), (("Without a judgement", f"{utc(since)} to {utc(at)}"),))
    title = f"ALL CLEAR {_name(glider)}: its dives can be judged again"
    return _alert(glider, at, Kind.ALL_CLEAR, title, page, alert_id, thread, Severity.INFO)


def _alert(
    glider: str,
    time: float,
    kind: Kind,
    title: str,
    page: Page,
    alert_id: str,
    thread: str,
    severity: Severity,
) -> Alert:
    title = clean(title)
    return Alert(
        id=alert_id,
        glider=glider,
        time=time,
        kind=kind,
        severity=severity,
        audience=Severity.WARNING,
        incident=thread,
        title=title,
        body=page.text(),
        html=page.html(title),
    )


def _reasons(items: tuple[Unjudged, ...]) -> list[tuple[Unjudged, int]]:
    """The reasons, the most frequent first: the latest item of each, and how many there are."""
    groups: defaultdict[tuple[object, str], list[Unjudged]] = defaultdict(list)
    for item in items:
        groups[item.cause, item.crc if item.cause is not None else item.words].append(item)
    found = [(group[-1], len(group)) for group in groups.values()]
    return sorted(found, key=lambda reason: -reason[1])[:_SHOWN]


def _reason(item: Unjudged, count: int) -> str:
    return f"{_counted(item, count)}: {clean(item.words, 300)}"


def _counted(item: Unjudged, count: int) -> str:
    what = "file" if item.is_file else "dive"
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def _cure(item: Unjudged) -> str:
    return CURES[item.cause].format(cache=f"{clean(item.crc, 40)}.cac")


def _name(glider: str) -> str:
    return clean(glider, 40)
