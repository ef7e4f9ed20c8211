"""Records of an earlier layout are converted to today's: nothing that was learnt is thrown away. Pure.

A state file that `state.keep_days` has cut begins with a checkpoint whose segments are gone. What it holds
cannot be made again, so a change of its shape converts it. How to add a converter: CONTRIBUTING.md, "a change
of the state".
"""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Mapping
from functools import reduce
from typing import Any

import numpy as np

from gliderwatch.estimation.kalman import JointParams, init
from gliderwatch.model import Array, Segment
from gliderwatch.pipeline import GliderState

Converter = Callable[[Any], Any]
"""From the decoded JSON of a value in one layout (an array is a dict of ``shape`` and ``f64``) to that in the
next. It may change its argument. Pure."""

UNUSABLE = {
    "no fix": "not_surfaced",
    "no fix before the dive": "no_fix_before",
    "mostly surface drift": "surface_drift",
}
UNUSABLE_BEGINS = {
    "data missing": "data_missing",
    "wild fix": "wild_fix",
    "stale": "stale_fix",
    "no heading": "no_heading",
    "turning": "turning",
}
"""Of layout 1: what the words of a dive said of why it cannot be used."""


HOUR, MINUTE = 3600.0, 60.0
FEATURES = {
    "duration_h": ("duration", HOUR),
    "drift_h": ("drift", HOUR),
    "heading_gap_h": ("heading_gap", HOUR),
    "unobserved_h": ("unobserved", HOUR),
    "fix_gap_minutes": ("fix_gap", MINUTE),
    "heading_mean": ("heading_mean", math.pi / 180),
}
"""Of layout 1: numbers of a dive that were not in SI, with their names and factors since."""


def typed_dives(state: Any) -> Any:
    """Layout 1 to 2: the numbers of a dive are typed features in SI, and why it cannot be used is a word of
    its own beside the reason.

    Incidents hold assessments too: those have a flag, so they are of dives that could be used.
    """
    dives = [state["navigation"]["dive"], state["last"]]
    for dive in (*dives, state["assessment"]):
        if dive is not None:
            reason = dive["reason"]
            begun = next((to for words, to in UNUSABLE_BEGINS.items() if reason.startswith(words)), None)
            dive["unusable"] = UNUSABLE.get(reason, begun)
    for dive in dives:
        if dive is not None:
            features = {}
            for name, value in dive.pop("evidence").items():
                new, factor = FEATURES.get(name, (name, 1.0))
                features[new] = int(value) if new == "yos" else value * factor
            dive["features"] = features
    return state


def one_sea(state: Any) -> Any:
    """Layout 2 to 3: the joint estimate has one model of the sea, with its time at the end of the last dive.

    The speed W, slip and side (the last three numbers of its state) stay, with their covariances, and all
    that is known of normal; the flow is to be learnt again, which takes a day, and so are hypotheses of a
    step.
    """
    for memory in (state["settled"], state["memory"]):
        speed = memory["estimate"]["joint"]["speed"]
        old = speed["joint"]
        if old is not None:
            new = init(JointParams(), old["t"] if old["end"] is None else old["end"]["t"])
            x, cov = np.array(new.x), np.array(new.cov)
            x[-3:], cov[-3:, -3:] = _array(old["x"])[-3:], _array(old["cov"])[-3:, -3:]
            kept = {name: old[name] for name in ("doubt", "dives", "nis", "dof", "end")}
            speed["joint"] = {**kept, "t": new.t, "x": _written(x), "cov": _written(cov)}
    return state


def one_level(state: Any) -> Any:
    """Layout 3 to 4: the estimate is one level, and its parts are called what they are.

    That a fix ended the last dive is remembered once, by the forecast.
    """
    state["changed"] = state.pop("told", [])
    for memory in (state["settled"], state["memory"]):
        memory["rules"] = memory.pop("watches", {})
        estimate = memory.setdefault("estimate", {})
        estimate.pop("end", None)
        joint = estimate.pop("joint", {})
        estimate |= joint
        speed = estimate.get("speed", {})
        if (kept := speed.pop("joint", None)) is not None:
            kept.pop("nis", None), kept.pop("dof", None)
            names = {"sea": "process_scale", "doubt": "measurement_scale"}
            speed["filter"] = {names.get(name, name): value for name, value in kept.items()}
    return state


def with_legs(state: Any) -> Any:
    """Layout 4 to 5: the last legs show where a glider heads that sends no waypoint; none is known yet."""
    for memory in (state["settled"], state["memory"]):
        memory.setdefault("surfacings", {})["legs"] = []
    return state


def plain_names(state: Any) -> Any:
    """Layout 5 to 6: what was called known or untold says of what."""
    navigation = state.get("navigation", {})
    for old, new in (("known", "last_reported"), ("untold", "pending")):
        if old in navigation:
            moved(navigation, old, new)
    for memory in (state.get("settled", {}), state.get("memory", {})):
        baseline = memory.get("estimate", {}).get("baseline", {})
        if "known" in baseline:
            moved(baseline, "known", "measured")
    return state


def foreseen_by_one_sea(state: Any) -> Any:
    """Layout 6 to 7: the reference `tides` is foreseen by the one model of the sea; what its dives were is to
    be learnt again, which takes a day."""
    for memory in (state.get("settled", {}), state.get("memory", {})):
        memory.get("estimate", {}).pop("currents", None)
    return state


def driven_dives(state: Any) -> Any:
    """Layout 7 to 8: healthy dives have the volumes pumped, not known of those that were; what lasts and what
    was slow is called so; a step that was thought of is taken for one of now, as no drift was kept."""
    for memory in (state.get("settled", {}), state.get("memory", {})):
        estimate = memory.get("estimate", {})
        for part in (estimate.get("speed", {}), estimate.get("learner", {})):
            if (normal := part.get("normal")) is not None and "speeds" in normal:
                dives = len(_array(normal["speeds"]))
                normal["volumes"] = _written(np.zeros((dives, 2)))
        speed = estimate.get("speed", {})
        if "doubted" in speed:
            speed["was_slow"] = bool(speed.pop("doubted"))
        if (kept := speed.get("filter")) is not None:
            if "wrong" in kept:
                moved(kept, "wrong", "lasting")
            if (bank := kept.get("bank", {})).get("score"):
                bank["begun"] = _written(np.full(len(_array(bank["score"])), float(kept["t"])))
    return state


def _array(written: Mapping[str, Any]) -> Array:
    """An array as a record holds it."""
    return np.frombuffer(base64.b64decode(written["f64"]), dtype="<f8").reshape(written["shape"])


def _written(array: Array) -> dict[str, Any]:
    """The same the other way."""
    data = np.ascontiguousarray(array, dtype="<f8")
    return {"shape": list(array.shape), "f64": base64.b64encode(data.tobytes()).decode()}


def same(segment: Any) -> Any:
    """Layout 1 to 2 of a segment: its notes are empty."""
    return segment


CONVERTERS: Mapping[type, tuple[Converter, ...]] = {
    GliderState: (
        typed_dives,
        one_sea,
        one_level,
        with_legs,
        plain_names,
        foreseen_by_one_sea,
        driven_dives,
    ),
    Segment: (same,),
}
"""For each kind of record the way from layout 1 to today's: the n-th leads from layout n to n + 1. What is in
it stays in it, for records of every layout are in use somewhere."""


def notified_of_schema_10(notified: Any) -> Any:
    """Schema 10 to 11: what people were notified of is called what it is."""
    for thread in notified.get("threads", ()):
        moved(thread, "told", "reported")
    for silence in notified.get("silences", ()):
        moved(silence, "awaited", "missed")
        moved(silence, "missed.heard", "missed.last_sign")
        moved(silence, "told", "stages")
    for episode in notified.get("aborts", ()):
        moved(episode, "told", "reports")
    if notified.get("empty") is not None:
        moved(notified, "empty.told", "empty.reported")
    return notified


ROW_CONVERTERS: Mapping[str, Converter] = {"notified_of_schema_10": notified_of_schema_10}
"""By name: functions that a migration in `database.MIGRATIONS` may call on the JSON text of a row, as
``UPDATE said SET data = notified_of_schema_7(data)``. Rows have no version of their own: their table has."""


def version(kind: type) -> int:
    """Today's layout of a kind of record; of what is no record of its own it is 1."""
    return 1 + len(CONVERTERS.get(kind, ()))


def converted(data: Any, kind: type, since: int) -> Any:
    """The decoded JSON of a record of layout `since` (1 or more, at most today's) in today's layout."""
    return reduce(lambda value, convert: convert(value), CONVERTERS.get(kind, ())[since - 1 :], data)


def moved(data: dict[str, Any], source: str, target: str) -> None:
    """Move a value to another place, both as dotted path: ``moved(state, "memory.estimate", "estimate")``.

    Objects on the way to the target that are not there are made; those that the source leaves empty stay.
    Raises KeyError where the source is not there: a converter that finds no such field is wrong.
    """
    *way, name = source.split(".")
    value = reduce(lambda at, step: at[step], way, data).pop(name)
    *way, name = target.split(".")
    reduce(lambda at, step: at.setdefault(step, {}), way, data)[name] = value
