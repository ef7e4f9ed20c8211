"""How restless the sea and how good the data are, learnt from what the innovations are. Pure."""

from __future__ import annotations

MEMORY, FEW = 40, 6
"""Dives over which noise is learnt, and how many the first guess of it counts for."""
FAR = 4.0
"""A normalised square above this counts as this much, so that a fault does not pass for noise."""
SEA, DOUBT = (0.1, 40.0), (0.25, 9.0)
"""Bounds of the factors on the variance of the flow's changes and of the measurements."""


def learn_sea(factor: float, square: float | None, share: float, dives: int) -> float:
    """The factor on the variance of the flow's changes after the ``square`` of one more innovation.

    ``square`` is normalised, 1 on average where the factor is right (None: no innovation); ``share`` of the
    innovation's variance depends on the factor: where the tides are not known yet it is small, and little is
    learnt. ``dives`` so far.

    >>> round(learn_sea(1.0, 2.0, 0.5, dives=4), 3)
    1.2
    """
    return _within(factor * (1 + 2 * min(2 * share, 1.0) * _part(dives) * _excess(square)), SEA)


def learn_doubt(factor: float, square: float | None, dives: int) -> float:
    """The factor on the variance of the measurements, likewise."""
    return _within(factor * (1 + _part(dives) * _excess(square)), DOUBT)


def _part(dives: int) -> float:
    return 1 / min(dives + FEW, MEMORY)


def _excess(square: float | None) -> float:
    return 0.0 if square is None else min(square, FAR) - 1


def _within(value: float, bounds: tuple[float, float]) -> float:
    return min(max(value, bounds[0]), bounds[1])
