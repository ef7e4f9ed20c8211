"""States of gliders that are ahead of their checkpoints: while a long list of files is taken in."""

from __future__ import annotations

from gliderwatch.model import SegmentId
from gliderwatch.pipeline import GliderState


class Ahead:
    """The newest state of each glider of which many files are at hand, in memory alone.

    Of a long list most checkpoints would be thinned out before anyone goes on from them. So they are not
    written; what is lost of them when the daemon ends is remade from the checkpoint before and the segments.
    """

    def __init__(self) -> None:
        self._states: dict[str, tuple[SegmentId, GliderState]] = {}
        self._unsure: set[str] = set()

    def keep(self, identity: SegmentId, state: GliderState) -> None:
        """Keep the state after a segment, the newest of its glider."""
        self._states[identity.glider] = identity, state
        self._unsure.add(identity.glider)

    def before(self, first: SegmentId) -> tuple[SegmentId, GliderState] | None:
        """The state kept of its glider, if it is of a segment before `first`."""
        kept = self._states.get(first.glider)
        return kept if kept is not None and kept[0] < first else None

    def drop(self, glider: str) -> None:
        """Know no state of a glider."""
        self._states.pop(glider, None)

    def commit(self) -> None:
        """What was kept since the last time is in the state file."""
        self._unsure.clear()

    def rollback(self) -> None:
        """It is not: forget it."""
        for glider in self._unsure:
            self.drop(glider)
        self._unsure.clear()
