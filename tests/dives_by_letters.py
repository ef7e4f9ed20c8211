"""A glider's dives by letters, and the messages that are due of them: for tests of
`incidents.notifications`."""

from __future__ import annotations

from dataclasses import dataclass, replace

from alert_support import SLOW
from gliderwatch.incidents.notifications import NotificationState, due_notifications
from gliderwatch.incidents.state_machine import RuleStates, advance
from gliderwatch.messages.notice_text import render
from gliderwatch.model import Alert, Assessment, Incident, NextSurfacing
from gliderwatch.params import RuleParams

HOUR = 3600.0
STEP = 3 * HOUR
"""From dive to dive."""
SPEEDS = {"0": 0.25, "1": 0.15, "S": 0.05, "2": 0.25}


def dive(k: int, letter: str, **changes: object) -> Assessment:
    """Dive number `k`: flags 0, 1, S (1, severe), 2, or - (assessed, no flag)."""
    flag = {"S": 1, "-": None}.get(letter, int(letter) if letter.isdigit() else None)
    t = k * STEP
    made = replace(SLOW, t_dive=t, t_surface=t + 2.5 * HOUR, flag=flag, speed=SPEEDS.get(letter))
    return replace(made, **changes)  # type: ignore[arg-type]


@dataclass
class World:
    """The facts of one glider: `incidents.notifications.IncidentFacts` over a dictionary of dives."""

    dives: dict[float, Assessment]
    rules: RuleParams = RuleParams()
    next: NextSurfacing | None = None

    @classmethod
    def of(cls, letters: str, rules: RuleParams | None = None) -> World:
        """The dives of some letters; a space is a dive that has not come."""
        made = [dive(k, letter) for k, letter in enumerate(letters) if letter != " "]
        return cls({a.t_dive: a for a in made}, rules or RuleParams())

    def incidents(self) -> tuple[Incident, ...]:
        """As the rules find them in all dives in order."""
        state, found = RuleStates(), {}
        for t in sorted(self.dives):
            state, changed = advance(state, self.dives[t], self.rules)
            found |= {i.id: i for i in changed}
        return tuple(sorted(found.values(), key=lambda i: (i.opened_at, i.id)))

    def dive(self, t_dive: float) -> Assessment | None:
        """The dive that began at a time."""
        return self.dives.get(t_dive)

    def expected(self, until: float) -> NextSurfacing | None:
        """The next surfacing, where the test gives one."""
        return self.next

    def last_surfacing(self, until: float) -> Assessment | None:
        """The last dive that surfaced until a time."""
        ended = [a for a in self.dives.values() if a.t_surface <= until and a.unusable is None]
        return max(ended, key=lambda a: a.t_surface, default=None)

    def came_up(self, t: float) -> str:
        """Nothing is known of why."""
        return ""


class Talk:
    """All messages while the dives of a world come in."""

    def __init__(self, reminder_hours: float | None = 24.0, notices: bool = False) -> None:
        self.notified, self.alerts = NotificationState(), list[Alert]()
        self.reminder_hours, self.notices, self.now = reminder_hours, notices, 0.0
        self.is_in_time = True

    def update(self, world: World | str, minutes: float = 60.0) -> list[str]:
        """The kinds of the messages that a world leads to, so long after the last look at it, or
        after its last surfacing if files come in time."""
        facts = World.of(world) if isinstance(world, str) else world
        latest = facts.last_surfacing(float("inf"))
        if self.is_in_time and latest is not None:
            self.now = max(self.now, latest.t_surface)
        self.now += 60 * minutes
        self.notified, new = due_notifications(
            self.notified, facts, self.reminder_hours, self.notices, now=self.now
        )
        self.alerts += map(render, new)
        return [str(a.kind) for a in new]
