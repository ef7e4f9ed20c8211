"""Whatever numbers a file holds: no crash, and nothing but finite numbers is written down."""

import json
import zlib

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gliderwatch.model import Segment
from gliderwatch.params import GliderParams, LearnerParams
from gliderwatch.pipeline import GliderState
from gliderwatch.service.routing import Routing
from gliderwatch.slocum.sensors import QUANTITIES
from gliderwatch.store import codec
from missions import START, ending, feed, segment

ROWS = {q.name: q for q in QUANTITIES if q.pair or q.name in ("heading", "pitch", "roll", "depth", "dr_time")}
ROWS |= {q.name: q for q in QUANTITIES if q.name in ("speed_onboard", "dr_state", "heading_commanded")}
PAIRS = [[q.name for q in QUANTITIES if q.pair == pair] for pair in {q.pair for q in QUANTITIES if q.pair}]
ALONE = [[q.name] for q in QUANTITIES if q.name in ROWS and not q.pair]


@st.composite
def segments(draw) -> list[Segment]:
    """A few segments of anything: near or far, sparse or dense, calm or wild, with any of the quantities."""
    out, t = [], START
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    groups = draw(st.lists(st.sampled_from(PAIRS + ALONE), min_size=1, max_size=12, unique_by=tuple))
    wild, spread = draw(st.sampled_from([0.0, 0.3, 1.0])), draw(st.sampled_from([0.0, 1e-5, 1e-4, 1.0]))
    for k in range(draw(st.integers(1, 6))):
        length = draw(st.sampled_from([0.0, 60.0, 1200.0, 9000.0, 40000.0]))
        held = {}
        for group in groups:
            n = int(rng.integers(0, 40))
            times = np.unique(t + rng.uniform(-60.0, length + 1.0, n))
            for name in group:
                share = spread if name.endswith(("_lat", "_lon")) else wild
                held[name] = list(zip(times, _values(name, len(times), rng, share), strict=True))
        declination = draw(st.sampled_from([None, 0.0, -0.3, 3.0]))
        out.append(segment(f"s{k}", t, held, declination=declination))
        t += length + draw(st.sampled_from([0.0, 300.0, 5000.0, 400000.0]))
    return out


def _values(name: str, n: int, rng: np.random.Generator, wild: float) -> np.ndarray:
    """Values in the range that ingest lets through: all over it, or near one place of it."""
    row = ROWS[name]
    middle = 0.3 * row.high + 0.7 * row.low
    return np.clip(middle + wild * (row.high - row.low) * rng.uniform(-0.7, 0.7, n), row.low, row.high)


def numbers(value: object):
    """All numbers and gaps of a decoded record, also those in its arrays."""
    if isinstance(value, dict) and set(value) == {"shape", "f64"}:
        yield from codec._to_array(np.ndarray, value).ravel().tolist()
    elif isinstance(value, dict | list):
        for x in value.values() if isinstance(value, dict) else value:
            yield from numbers(x)
    elif isinstance(value, float | int):
        yield value


SPEAKING = Routing(channels=lambda alert: ["mail"], notices=lambda glider: True)
PARAMS = [
    GliderParams(),
    GliderParams(
        estimator="adaptive",
        learner=LearnerParams(kernel="gaussian", sigma=2e3, max_speed=0.4, omega=1e-5),
    ),
    GliderParams(
        estimator="adaptive", learner=LearnerParams(gamma=1e-4, speed_gain=0.0, centres=((10.0, 20.0),))
    ),
]


@settings(max_examples=80, suppress_health_check=[HealthCheck.too_slow])
@given(segments(), st.sampled_from(PARAMS))
def test_any_numbers(made, params):
    store = feed(made, params, SPEAKING)
    record = ending(store, "unit").state
    assert np.isfinite(list(numbers(json.loads(zlib.decompress(record))))).all()
    assert codec.encode(codec.decode(record, GliderState)) == record
    for a in store.assessments("unit"):
        optional = (a.lat, a.lon, a.speed, a.flow_u, a.flow_v, a.reference_u, a.p_e, a.clle_max, a.excitation)
        known = [x for x in optional if x is not None]
        assert np.isfinite([*known, a.t_dive, a.t_surface, *a.evidence.values()]).all()
        assert a.flag is None or a.speed is not None
        assert (a.flag == 0) == (a.reason == "")
    for table in ("assessments", "incidents", "said", "alerts"):
        texts = [r[0] for r in store._db.execute(f"SELECT data FROM {table}")]
        assert not any("NaN" in text or "Infinity" in text for text in texts)
