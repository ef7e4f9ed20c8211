"""What people read when no dive of a glider can be judged although files come, and when that ends. Pure."""

from __future__ import annotations

from collections import defaultdict

from gliderwatch.incidents.notices import Blind, JudgedAgain, Unjudged
from gliderwatch.messages.formatting import clean, duration, utc
from gliderwatch.messages.phrases import mute_link, name_of, next_call, where
from gliderwatch.messages.template import Page, Text, sentence, titled
from gliderwatch.model import Hindrance, Unusable

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


_SHORT: dict[Unusable | Hindrance | None, str] = {
    Hindrance.NO_CACHE: "cache file missing",
    Hindrance.UNREADABLE: "files unreadable",
    Hindrance.DAMAGED: "files damaged",
    Hindrance.NOT_ASSESSED: "fault of gliderwatch",
    Unusable.NOT_SURFACED: "no fix",
    Unusable.NO_FIX_BEFORE: "no fix",
    Unusable.STALE_FIX: "old fix",
    Unusable.WILD_FIX: "wild fix",
    Unusable.DATA_MISSING: "files missing",
    Unusable.SURFACE_DRIFT: "no dives seen",
    Unusable.NO_HEADING: "no heading",
    Unusable.TURNING: "heading unclear",
}
"""Each reason in a title."""


def blind(glider: str, content: Blind) -> Text:
    """No dive can be judged, or still none can."""
    found, now, reasons = content.found, content.situation, _reasons(content.found.items)
    (main, count), lasted = reasons[0], duration(found.until - found.since)
    of = len(found.items)
    first = f"{'No' if content.first else 'Still no'} dive of {name_of(glider)} could be judged since "
    first += f"{utc(found.since)} ({lasted}); sure ({count} of {of}): {clean(main.words, 120)}. "
    first += "A fault of the glider would not be seen."
    last = "none yet" if found.judged is None else f"surfaced {utc(found.judged)}"
    if not content.first:
        (label, command), *_ = mute_link(glider)
        lead = (
            first,
            f"Not better. Last judged dive: {last}.",
            where(now.last),
            next_call(now.expected),
        )
        short = _SHORT.get(main.cause, "")
        title = titled(glider, f"STILL CANNOT BE JUDGED for {lasted}", f": {short}" if short else "")
        return title, Page((*lead, f"{label}: {command}"))
    others = tuple(_reason(*reason) for reason in reasons[1:])
    page = Page(
        (first, where(now.last), next_call(now.expected)),
        (
            ("Last dive that could be judged", last),
            ("Main reason", f"{_counted(main, count)}: {clean(main.words, 300)}"),
        ),
        ((("Other reasons", others),) if others else ()),
        tuple(dict.fromkeys(_cure(item) for item, _ in reasons))[:3],
        mute_link(glider),
    )
    short = _SHORT.get(main.cause, "")
    return titled(glider, f"CANNOT BE JUDGED for {lasted}", f": {short}" if short else ""), page


def judged_again(glider: str, content: JudgedAgain) -> Text:
    """A dive could be judged again."""
    lasted = duration(content.at - content.since)
    first = f"Dives of {name_of(glider)} can be judged again, after {lasted} without a judgement."
    page = Page(
        (first,),
        (("Without a judgement", f"{utc(content.since)} to {utc(content.at)}"),),
        do=("Nothing.",),
    )
    return titled(glider, "ALL CLEAR: its dives can be judged again"), page


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
    return sentence(CURES[item.cause].format(cache=f"{clean(item.crc, 40)}.cac")) + "."
