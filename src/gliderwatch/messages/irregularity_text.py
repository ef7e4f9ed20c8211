"""What the operator reads of files that are wrong although the flight may be right. Pure."""

from __future__ import annotations

from gliderwatch.incidents.notices import Irregularity, OldDates, TwoGliders
from gliderwatch.messages.formatting import duration, place, utc
from gliderwatch.messages.phrases import name_of
from gliderwatch.messages.template import Page, Text, lead_and_actions, titled
from gliderwatch.navigation.clock import DAY, ROLLOVER, ClockStep, span


def irregular(_: str, found: Irregularity) -> Text:
    """Files of a glider are wrong although its flight may be right."""
    lead, todo = lead_and_actions(_text(found))
    first = f"{name_of(found.glider)}: {title(found)}, since {utc(found.t)}."
    return titled(found.glider, _short(found)), Page((first, *lead), do=todo)


def _short(found: Irregularity) -> str:
    what = found.what
    if isinstance(what, OldDates):
        return f"OLD DATES: files are {_age(what)} old"
    if isinstance(what, TwoGliders):
        return "TWO GLIDERS under this name"
    if what.step < 0:
        return "CLOCK right again"
    by = f" by {span(abs(what.step))}" if what.is_corrected else ", not known by how much"
    return f"CLOCK fell back{by}"


def title(found: Irregularity) -> str:
    """What is wrong, in one line."""
    what, glider = found.what, found.glider
    if isinstance(what, OldDates):
        return f"files of {glider} are dated {_age(what)} before they came"
    if isinstance(what, TwoGliders):
        return f"files of two gliders come under the name {glider}"
    if what.step < 0:
        return f"the clock of {glider} is right again"
    size = span(abs(what.step)) if what.is_corrected else ""
    return (
        f"the clock of {glider} fell back by {size}"
        if size
        else (f"the clock of {glider} fell back, by how much is not known")
    )


def _text(found: Irregularity) -> str:
    """What is known of it, and what to do; one paragraph a line."""
    what = found.what
    if isinstance(what, OldDates):
        return (
            f"The first of mission {what.mission} came {utc(what.at)}: {what.first}, of {utc(what.t)}. "
            "Either the glider has a wrong clock, or somebody has put old files into its folder.\n"
            "Its dives are kept apart, under the dates that the glider gave; the glider counts as heard.\n"
            "What to do: set the glider's clock when it calls next. If the files are old, nothing."
        )
    if isinstance(what, TwoGliders):
        a, b = what.a, what.b
        apart, between = what.apart / 1000, duration(max(b.t - a.t, 60.0))
        return (
            f"Its positions alternate between {place(a.lat, a.lon)} and {place(b.lat, b.lon)}, "
            f"{apart:.0f} km apart within {between}: no glider flies so fast. None of its dives can be "
            "trusted.\n"
            "What to do: see which other glider has this name in the header of its files (a simulator, a "
            "glider on the bench, a copied autoexec.mi), and keep its files out of this folder."
        )
    return _clock(what)


def _clock(step: ClockStep) -> str:
    size = span(abs(step.step))
    if step.step < 0:
        return f"It was {size} behind until {utc(step.t)}. Nothing is corrected from {step.segment} on."
    if step.is_corrected:
        return (
            f"By its number segment {step.segment} follows the one before, so it opened about "
            f"{utc(step.t)}; its own times are {size} earlier. {_why(step.step)}\n"
            "Its dives, and those that follow, are put on the right time and assessed as before. A note "
            "with each says so.\n"
            "What to do: set the glider's clock when it calls next, and see what its log says of the time."
        )
    return (
        f"Segment {step.segment} has a higher number than those before, but its times are at least "
        f"{size} earlier. {_why(step.step)}\n"
        "Segments before it are missing, so the right time is not known. Its dives are kept apart, "
        "under the dates that the glider gave, until the missing files come.\n"
        "What to do: set the glider's clock when it calls next, and have the missing files sent again."
    )


def _age(what: OldDates) -> str:
    return span(round((what.at - what.t) / DAY) * DAY)


def _why(step: float) -> str:
    if step == ROLLOVER:
        return (
            "1024 weeks are the period after which GPS counts its weeks from 0 again: the receiver's "
            "firmware is too old to know the present one."
        )
    return "The clock was set, or lost its time in a restart."
