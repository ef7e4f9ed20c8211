"""The fields of a fleet in a state file: any order and any repetition end in the same field; checkpoints are
thinned."""

import random
from pathlib import Path

import numpy as np
import pytest

from gliderwatch.errors import DamagedError
from gliderwatch.fleet import scalar_field as sf
from gliderwatch.fleet.advice import Advice
from gliderwatch.fleet.batches import packed, unpacked
from gliderwatch.fleet.scalar_field import Batch, FieldParams
from gliderwatch.store.state_file import Store

PARAMS, T0 = FieldParams("literal"), 1.7e9


def batch(k: int, hour: float, n: int = 8) -> Batch:
    rng = np.random.default_rng([3, k])
    t = T0 + hour * 3600 + 300.0 * np.arange(n)
    whole = Batch(f"b{k:02}", f"g{k % 3}", t, rng.uniform(0, 1, (n, 3)), rng.normal(size=n), np.full(n, 30.0))
    return unpacked(packed(whole), whole.id, whole.glider)


BATCHES = [batch(k, 1.7 * k) for k in range(9)]


def test_any_order_and_repetition_is_one_field(tmp_path: Path):
    whole = sf.run(None, BATCHES, PARAMS)[-1]
    for seed in (0, 1):
        store = Store.open(tmp_path / f"{seed}.sqlite")
        order = random.Random(seed).sample(BATCHES + BATCHES[:3], 12)
        for k, each in enumerate(order):
            with store.transaction():
                assert store.fields.put("sst", [each]) == (each not in order[:k])
                if k % 3 != 1:  # many at hand
                    store.fields.advance("sst", PARAMS)
            if k == 6:  # a restart
                store.close()
                store = Store.open(tmp_path / f"{seed}.sqlite")
        with store.transaction():
            last = store.fields.advance("sst", PARAMS)
        assert last.bin == whole.bin
        np.testing.assert_array_equal(last.known.d, whole.known.d)
        store.close()
        looking = Store.reading(tmp_path / f"{seed}.sqlite")
        np.testing.assert_array_equal(looking.fields.newest("sst", PARAMS).known.g, whole.known.g)
        assert looking.fields.extent("sst") == (9, BATCHES[0].t[0], BATCHES[-1].t[-1])
        looking.close()


def test_what_is_rolled_back_is_not_known(tmp_path: Path):
    store = Store.open(tmp_path / "s.sqlite")
    with store.transaction():
        store.fields.put("sst", BATCHES[:3])
    before = store.fields.newest("sst", PARAMS)
    with pytest.raises(RuntimeError), store.transaction():
        store.fields.put("sst", BATCHES[3:])
        store.fields.advance("sst", PARAMS)
        raise RuntimeError
    np.testing.assert_array_equal(store.fields.newest("sst", PARAMS).known.d, before.known.d)


def test_a_fuller_copy_takes_the_place_of_the_shorter(tmp_path: Path):
    store = Store.open(tmp_path / "s.sqlite")
    longer = batch(2, 3.4, 20)
    with store.transaction():
        store.fields.put("sst", BATCHES[:3])
        assert store.fields.put("sst", [longer])
        assert not store.fields.put("sst", [BATCHES[2]])
    whole = sf.run(None, [*BATCHES[:2], longer], PARAMS)[-1]
    np.testing.assert_array_equal(store.fields.newest("sst", PARAMS).known.d, whole.known.d)


def test_other_settings_begin_anew(tmp_path: Path):
    store = Store.open(tmp_path / "s.sqlite")
    with store.transaction():
        assert store.fields.begin("sst", "a")
        store.fields.put("sst", BATCHES[:3])
        store.fields.sound("sst", np.array([[50.001, 0.0, 80.0], [50.002, 0.001, 40.0], [51.0, 0.0, 9.0]]))
        store.fields.advise("sst", "g0", T0, Advice(1.0, 50.0, 0.0, 0.1, None))
        assert not store.fields.begin("sst", "a")
        assert sorted(store.fields.soundings("sst")[:, 2]) == [9.0, 40.0]
        assert store.fields.advice("g0", T0)[0][2].heading == 1.0
        assert store.fields.begin("sst", "b")
    assert store.fields.newest("sst", PARAMS) is None
    assert store.fields.advice("g0", 0.0) == []


def test_a_month_keeps_few_checkpoints_and_a_damaged_one_is_told(tmp_path: Path, monkeypatch):
    monkeypatch.setattr("gliderwatch.store.sea.RECENT", 3)
    store = Store.open(tmp_path / "s.sqlite")
    with store.transaction():
        store.fields.put("sst", [batch(k, 7.0 * k, 2) for k in range(24)])
        store.fields.advance("sst", PARAMS)
    n = store._db.execute("SELECT count(*) FROM field_checkpoints").fetchone()[0]
    assert 3 + 5 <= n <= 3 + 8
    store._db.execute("UPDATE field_checkpoints SET data = x'00'")
    store.fields.rollback()
    with pytest.raises(DamagedError):
        store.fields.newest("sst", PARAMS)
