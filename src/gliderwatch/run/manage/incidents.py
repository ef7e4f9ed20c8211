"""The incidents of all gliders, and who has taken them on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from gliderwatch.alerts.words import clean
from gliderwatch.config import Config
from gliderwatch.errors import GliderwatchError
from gliderwatch.model import Assessment, Incident
from gliderwatch.rules.acknowledged import Ack, acknowledge
from gliderwatch.run.lines import iso
from gliderwatch.run.manage.opening import reading, writing
from gliderwatch.run.posting import withdraw_answered
from gliderwatch.store.sqlite import Store


@dataclass(frozen=True, slots=True)
class Noted:
    """An incident and its acknowledgement, if there is one."""

    incident: Incident
    ack: Ack | None

    @property
    def is_quiet(self) -> bool:
        """Whether nobody is reminded of it because of the acknowledgement."""
        return self.ack is not None and self.ack.holds(self.incident)


def incidents(config: Config, glider: str | None = None, *, every: bool = False) -> list[Noted]:
    """The open incidents (`every`: all) of one glider or of all, by glider and time.

    Raises GliderwatchError where nothing is known of the glider asked for.
    """
    with reading(config) as store:
        names = sorted({*config.gliders, *store.gliders()})
        if glider is not None and glider.lower() not in names:
            raise GliderwatchError(
                f"there is no glider {glider}; known are: {', '.join(map(clean, names)) or 'none'}"
            )
        wanted = names if glider is None else [glider.lower()]
        return [noted for name in wanted for noted in _of(store, name, every)]


def _of(store: Store, glider: str, every: bool) -> list[Noted]:
    acks = store.notes.acks(glider)
    found = (i for i in store.incidents(glider) if every or i.cleared_at is None)
    return [Noted(i, acks.get(i.id)) for i in found]


def ack(config: Config, identity: str, by: str, note: str, now: float) -> tuple[Noted, bool]:
    """Take an open incident on; with it, and whether that is new: the same once more changes nothing.

    Who waits for an acknowledgement is not told of it any more.
    Raises GliderwatchError, naming those that are open, where it is none of them.
    """
    with writing(config) as store:
        known = [noted for glider in store.gliders() for noted in _of(store, glider, every=True)]
        noted = next((n for n in known if n.incident.id == identity.strip()), None)
        if noted is None or noted.incident.cleared_at is not None:
            raise GliderwatchError(_refusal(identity, noted, known))
        before = noted.ack
        if noted.is_quiet and before is not None and (before.by, before.note) == (by, note):
            return noted, False
        made = acknowledge(noted.incident, by, note, now)
        store.notes.acknowledge(noted.incident.glider, made)
        withdraw_answered(store, noted.incident.glider, now)
    return Noted(noted.incident, made), True


def _refusal(identity: str, noted: Noted | None, known: list[Noted]) -> str:
    wrong = "there is no incident" if noted is None else "there is nothing left to do: cleared is incident"
    opened = [n.incident.id for n in known if n.incident.cleared_at is None]
    listed = "".join(f"\n  {clean(i)}" for i in opened) if opened else " none"
    return f"{wrong} {clean(identity)}; open are:{listed}"


def as_json(noted: Noted) -> dict[str, Any]:
    """An incident for machines."""
    i = noted.incident
    return {
        "id": i.id,
        "glider": i.glider,
        "kind": str(i.kind),
        "severity": i.severity.name.lower(),
        "since": iso(i.since),
        "opened_at": iso(i.opened_at),
        "cleared_at": None if i.cleared_at is None else iso(i.cleared_at),
        "dives": i.dives,
        "worst": _dive(i.worst),
        "last": _dive(i.last),
        "acknowledged": None if noted.ack is None else ack_json(noted.ack, i),
    }


def ack_json(made: Ack, incident: Incident) -> dict[str, Any]:
    """An acknowledgement for machines; `worse`: the incident has grown worse since."""
    return {"by": made.by, "note": made.note, "at": iso(made.at), "worse": not made.holds(incident)}


def _dive(a: Assessment) -> dict[str, Any]:
    return {
        "t_dive": iso(a.t_dive),
        "t_surface": iso(a.t_surface),
        "flag": a.flag,
        "speed": a.speed,
        "speed_min": a.speed_min,
        "speed_max": a.speed_max,
        "p_e": a.p_e,
    }
