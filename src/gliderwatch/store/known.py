"""What is known of one glider, as the rules ask for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gliderwatch.model import Assessment, Expected, Incident
from gliderwatch.rules.silence import Sign

if TYPE_CHECKING:
    from gliderwatch.store.sqlite import Store


class Known:
    """`rules.announce.Known` and `rules.overdue.Known` of one glider."""

    def __init__(self, store: Store, glider: str) -> None:
        self._store, self.glider = store, glider

    def incidents(self) -> tuple[Incident, ...]:
        """All its incidents."""
        return tuple(self._store.incidents(self.glider))

    def dive(self, t_dive: float) -> Assessment | None:
        """The dive that began at a time (s)."""
        return self._store.dive(self.glider, t_dive)

    def last_surfacing(self, until: float) -> Assessment | None:
        """The last dive that has ended with a fix and surfaced at `until` (s) or before."""
        return self._store.last_surfacing(self.glider, until)

    def expected(self, until: float) -> Expected | None:
        """What was expected after the last surfacing at `until` (s) or before."""
        return self._store.expected(self.glider, until)

    def first_surfacing(self, after: float) -> float | None:
        """The first surfacing later than `after` (s)."""
        return self._store.first_surfacing(self.glider, after)

    def has_dived(self, since: float) -> bool:
        """Whether a dive began at `since` (s) or later, also one that has not ended or cannot be used."""
        return self._store.has_dived(self.glider, since)

    def signs(self, since: float) -> tuple[Sign, ...]:
        """Its files that were opened at `since` (s) or later."""
        return self._store.signs(self.glider, since)
