"""How a dive can be explained: the table of modes, and how likely each is after a dive. Pure.

A multi-process model (Harrison and Stevens 1976): beside "as usual" a dive may show another speed, another
flow, a wrong current or a wrong ground velocity; and the speed that the glider tells beside the current may
have nothing to do with the speed. Each mode opens one thing. An iterated update finds the likeliest state
under each, log-sum-exp over the modes their weights, and the state after the dive is the mixture (GPB of
order one).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache
from math import log, pi, sqrt

import numpy as np

from gliderwatch.estimation.constants import (
    BEYOND,
    CURRENT_CHANCE,
    CURRENT_ERROR,
    FASTEST,
    FLOW_CHANCE,
    FRONT,
    GROUND_CHANCE,
    GROUND_ERROR,
    ITERATIONS,
    LEAST_SLIP,
    LEFT_OUT,
    LOST_SLIP,
    LOST_SPREAD,
    MOST_SIDE,
    MOST_SLIP,
    SPEED_CHANCE,
    SPEED_STEP,
    STAYS,
    WING_ODDS,
    WING_SIDE,
    WING_SLIP,
)
from gliderwatch.estimation.dive_measurement import OWN, SHOWN, SIDE, SLIP, Measured, expected
from gliderwatch.model import Array, readonly


class Cause(StrEnum):
    """How a dive is explained."""

    USUAL = "as usual"
    SPEED = "another speed"
    FLOW = "another flow"
    CURRENT = "wrong current"
    GROUND = "wrong ground velocity"
    WING = "a wing lost or bent"

    @property
    def is_error(self) -> bool:
        """Whether it says that one of the measurements is wrong."""
        return self in (Cause.CURRENT, Cause.GROUND)

    @property
    def lasts(self) -> bool:
        """Whether what explained a dive may well explain the next one: a measurement that is wrong stays so,
        and of a speed that changed during a dive the rest is seen on the next."""
        return self.is_error or self is Cause.SPEED


@dataclass(frozen=True, slots=True)
class Mode:
    """``chance`` of it on a dive, how large what it opens usually is (``size``, m/s, a component), the
    ``words`` for a dive that it explains best, and the ``loss`` (part of W) that is expected of it."""

    cause: Cause
    chance: float
    size: float
    words: str = ""
    loss: float = 0.0


MODES = (
    Mode(Cause.USUAL, 1 - (SPEED_CHANCE + FLOW_CHANCE + CURRENT_CHANCE + GROUND_CHANCE), 0.0),
    Mode(Cause.SPEED, SPEED_CHANCE, SPEED_STEP),
    Mode(Cause.FLOW, FLOW_CHANCE, FRONT),
    Mode(
        Cause.CURRENT,
        CURRENT_CHANCE,
        CURRENT_ERROR,
        "the current does not fit those before, the ground velocity does",
    ),
    Mode(
        Cause.GROUND,
        GROUND_CHANCE,
        GROUND_ERROR,
        "the ground velocity does not fit, the current does: fixes or headings are wrong",
    ),
)


def switched(
    modes: tuple[Mode, ...], before: Mapping[Cause, float], turning: float = 0.0
) -> tuple[Mode, ...]:
    """The modes with the chances that they have after a dive which was explained so ``before``. ``turning``:
    the chance that the glider turned unseen, so that its ground velocity does not fit."""
    least = {Cause.GROUND: turning}
    rare = (
        (mode.cause, max(mode.chance, least.get(mode.cause, 0.0), STAYS * before.get(mode.cause, 0.0)))
        for mode in modes
        if mode.cause.lasts
    )
    return _with_chances(modes, tuple(rare))


@lru_cache(maxsize=64)  # on nearly all dives nothing was wrong before
def _with_chances(modes: tuple[Mode, ...], chances: tuple[tuple[Cause, float], ...]) -> tuple[Mode, ...]:
    """The modes where these have other chances, and the rest what is left, in proportion."""
    rare = dict(chances)
    left = 1 - sum(rare.values())
    rest = sum(mode.chance for mode in modes if mode.cause not in rare)
    return tuple(
        replace(mode, chance=rare.get(mode.cause, mode.chance / rest * left if rest else left))
        for mode in modes
    )


_LOWEST = readonly([0.0, LEAST_SLIP, -MOST_SIDE])
_HIGHEST = readonly([FASTEST, MOST_SLIP, MOST_SIDE])
"""What W (m/s), slip and side can be."""
ROLLED = Mode(Cause.WING, WING_ODDS, WING_SLIP)
"""Beside these where the glider has just begun to roll otherwise, which little else does. ``size`` is of
slip."""
LOST = Mode(Cause.WING, WING_ODDS, LOST_SPREAD, loss=LOST_SLIP)
"""The same where it rolls so far that it must be a lost wing, which makes no glider faster."""


@dataclass(frozen=True, slots=True)
class Explained:
    """A dive as one of the modes has it.

    ``mode`` with its ``weight``; ``kinematic_fits``: whether the kinematic speed has to do with W.
    ``rows`` ((m, 5)), ``innovation`` ((m,)) and ``noise`` ((m, m)) are linear about the likeliest state;
    ``square`` is the innovation normalised.
    """

    mode: Mode
    weight: float
    kinematic_fits: bool
    rows: Array
    innovation: Array
    noise: Array
    weight_matrix: Array

    @property
    def cause(self) -> Cause:
        """What the mode makes of the dive."""
        return self.mode.cause

    @property
    def square(self) -> float:
        """The normalised innovation squared."""
        return float(self.innovation @ self.weight_matrix @ self.innovation)


@dataclass(frozen=True, slots=True)
class Explanations:
    """A dive in all modes.

    ``ways`` with weights that add up to 1; ``odds`` of each cause; ``best`` the weightiest way of the
    likeliest cause, ``usual`` the usual one that does so with the same kinematic speed (None: none).
    """

    ways: list[Explained]
    odds: dict[str, float]
    best: Explained
    usual: Explained | None

    @classmethod
    def of(cls, ways: list[Explained]) -> Explanations:
        """All that ways say together."""
        odds: dict[str, float] = {}
        for way in ways:
            odds[str(way.cause)] = odds.get(str(way.cause), 0) + way.weight
        cause = max(odds, key=lambda each: odds[each])
        best = max((way for way in ways if str(way.cause) == cause), key=lambda way: way.weight)
        usual = (
            way for way in ways if way.cause is Cause.USUAL and way.kinematic_fits == best.kinematic_fits
        )
        return cls(ways, odds, best, next(usual, None))


def explain(
    x: Array, cov: Array, jumped: Array, measured: Measured, modes: tuple[Mode, ...]
) -> list[Explained]:
    """The dive in each of the modes, with weights that add up to 1.

    ``x`` ((5,)) and ``cov`` ((5, 5)) are what was expected of the numbers that a dive shows, ``jumped`` ((5,
    5)) how these vary where the flow steps by 1 m/s.
    """
    if not measured.has_current:
        modes = tuple(mode for mode in modes if not mode.cause.is_error)
    kinematic = measured.kinematic
    values = measured.values
    ways = _ways(modes, None if kinematic is None else kinematic.lies, len(values))
    opened, wrong, each = cov + ways.opened, ways.wrong, ways.each
    for k, square in ways.jumps:
        opened[k] += square * jumped
    before = np.repeat(x[None], len(each), axis=0)
    before[:, SLIP] += ways.losses
    state = before
    for _ in range(ITERATIONS):
        found, slope, noise = expected(state, measured)
        noise = noise + wrong
        turned = opened @ slope.transpose(0, 2, 1)
        s = slope @ turned + noise
        inverse = np.linalg.inv(s)
        innovation = values - found - (slope @ (before - state)[:, :, None])[:, :, 0]
        state = before + (turned @ (inverse @ innovation[:, :, None]))[:, :, 0]
        free = state[:, OWN].copy()
        np.minimum(np.maximum(state[:, OWN:], _LOWEST), _HIGHEST, out=state[:, OWN:])
    beyond = np.maximum(np.maximum(-free, free - FASTEST), 0.0)
    squares = (innovation[:, None, :] @ inverse @ innovation[:, :, None])[:, 0, 0]
    weights = _weights(ways.logs, beyond, np.linalg.slogdet(s)[1] + squares)
    noise[wrong > 0] = LEFT_OUT**2
    at = ways.with_wrong
    inverse[at] = np.linalg.inv(slope[at] @ turned[at] + noise[at])
    return [
        Explained(mode, weight, fits_it, slope[k], innovation[k], noise[k], inverse[k])
        for k, ((mode, fits_it), weight) in enumerate(zip(each, weights.tolist(), strict=True))
    ]


def _weights(logs: Array, beyond: Array, misfits: Array) -> Array:
    """Weights ((k,)) that add up to 1: by logarithms of the chances, by how far (m/s) the own speed is
    ``beyond`` what it can be, and by minus twice the logarithms of the likelihoods."""
    logs = logs - 0.5 * (beyond / BEYOND) ** 2
    logs = logs - 0.5 * misfits
    weights = np.exp(logs - logs.max())
    return np.asarray(weights / weights.sum())


@dataclass(frozen=True, slots=True)
class _Ways:
    """What does not depend on the dive of k modes with and without a fitting kinematic speed (``each``):
    what is added to the covariance of the state (``opened``, (k, 5, 5)), where and by what square (m2/s2) the
    flow steps beside that (``jumps``), what is added to the noise (``wrong``, (k, m, m)) and of which ways
    that is any (``with_wrong``), logarithms of the chances (``logs``, (k,)), ``losses`` ((k,)) of slip."""

    each: tuple[tuple[Mode, bool], ...]
    opened: Array
    jumps: tuple[tuple[int, float], ...]
    wrong: Array
    with_wrong: list[int]
    logs: Array
    losses: Array


@lru_cache(maxsize=64)
def _ways(modes: tuple[Mode, ...], lies: float | None, m: int) -> _Ways:
    """The ways to explain a dive with m measurements, the last of them a kinematic speed that ``lies`` so
    often (None: there is none)."""
    fits = (True, False) if lies is not None else (False,)
    each = tuple((mode, fits_it) for mode in modes for fits_it in fits)
    opened, wrong = np.zeros((len(each), SHOWN, SHOWN)), np.zeros((len(each), m, m))
    logs, jumps = np.zeros(len(each)), list[tuple[int, float]]()
    for k, (mode, fits_it) in enumerate(each):
        logs[k] = log(mode.chance)
        if mode.cause is Cause.SPEED:
            opened[k, OWN, OWN] = mode.size**2
        elif mode.cause is Cause.FLOW:
            jumps.append((k, mode.size**2))
        elif mode.cause is Cause.WING:
            opened[k, SLIP, SLIP] = mode.size**2
            opened[k, SIDE, SIDE] = WING_SIDE**2
        elif mode.cause.is_error:
            at = 2 if mode.cause is Cause.CURRENT else 0
            wrong[k, at, at] = wrong[k, at + 1, at + 1] = mode.size**2
        if lies is not None:
            logs[k] += log(1 - lies) if fits_it else log(lies)
            if not fits_it:  # it may be anything: of density 1 / FASTEST
                wrong[k, -1, -1] = FASTEST**2
                logs[k] += log(sqrt(2 * pi))
    at_fault = np.flatnonzero((wrong > 0).any(axis=(1, 2))).tolist()
    losses = readonly([mode.loss for mode, _ in each])
    return _Ways(each, readonly(opened), tuple(jumps), readonly(wrong), at_fault, readonly(logs), losses)
