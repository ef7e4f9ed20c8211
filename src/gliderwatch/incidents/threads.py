"""What the messages of all kinds of incidents share: the name of a thread, and what it is about. Pure."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Protocol, TypeVar


class _Named(Protocol):
    @property
    def id(self) -> str:
        """Its stable id."""


Incident = TypeVar("Incident", bound=_Named)


def thread_id(identity: str, used: Iterable[str]) -> str:
    """The id of a new thread: ``identity``, with one plus more than the last of these that is ``used``
    already.

    >>> thread_id("a/abort/5", ["b/abort/5"]), thread_id("a/abort/5", ["a/abort/5", "a/abort/5+"])
    ('a/abort/5', 'a/abort/5++')
    """
    same = [each for each in used if each.rstrip("+") == identity]
    return max(same, key=len) + "+" if same else identity


def by_thread(
    reported: Mapping[str, Incident],
    incidents: Iterable[Incident],
    is_same: Callable[[Incident, Incident], bool],
) -> dict[str, Incident]:
    """For each thread the incident that it is about now: the one ``reported`` (by thread), else the first
    that `is_same` (incident, reported) and that no other thread is about."""
    by_id = {i.id: i for i in incidents}
    out = {thread: by_id[was.id] for thread, was in reported.items() if was.id in by_id}
    free = [i for i in by_id.values() if i not in out.values()]
    for thread, was in reported.items():
        if thread not in out and (near := next((i for i in free if is_same(i, was)), None)) is not None:
            out[thread] = near
            free.remove(near)
    return out
