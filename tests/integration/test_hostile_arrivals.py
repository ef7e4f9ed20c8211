"""Files of a mission in any order, cut, completed and sent again, through ledger, decoder and state file."""

from __future__ import annotations

import random
import tempfile
from collections.abc import Iterable, Sequence
from itertools import count
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gliderwatch.errors import GliderwatchError
from gliderwatch.model import Assessment, Incident
from gliderwatch.params import GliderParams
from gliderwatch.service import judgement, transaction
from gliderwatch.service.backlog import Job
from gliderwatch.simulate.delivery import arrivals as sent
from gliderwatch.simulate.delivery import write_cache
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Fault, FaultKind, Scenario
from gliderwatch.slocum.decode import decode
from gliderwatch.store.state_file import Store

REMORA = Fault(FaultKind.REMORA, Scenario().start + 0.7 * 86400, 8.0)
MISSION = simulate(Scenario(seed=4, glider="bruce", days=1.3, faults=(REMORA,)))
WHOLE = [file.data for file in sent(MISSION)]

Result = tuple[list[Assessment], list[Incident]]
Copy = tuple[int, str, float]
"""A copy that arrives: of which file, under which name, and what part of its bytes."""


class Shore:
    """A from-glider folder, and what a daemon does with each file as it comes."""

    def __init__(self, folder: Path, caches: Path) -> None:
        self.inbox, self.caches, self.store = folder, caches, Store.open(":memory:")
        self._clock = count(1)

    def arrive(self, name: str, data: bytes) -> None:
        """One file is there, or has changed."""
        path = self.inbox / name
        path.write_bytes(data)
        job = judgement.judge(path, self.store, [self.caches], lambda _: True)
        now = float(next(self._clock))
        if isinstance(job, Job):
            try:
                segment = decode(path, [self.caches])
            except GliderwatchError as error:
                self.store.record(judgement.failed(job.file, error), now)
            else:
                transaction.process_file(self.store, job.file, segment, GliderParams(), None, now)
        elif job is not None:
            self.store.record(job, now)

    def result(self) -> Result:
        """What it came to."""
        (glider,) = self.store.gliders()
        return self.store.assessments(glider), self.store.incidents(glider)


def ending(whole: Sequence[bytes], copies: Iterable[Copy], caches: Path) -> Result:
    """The result once copies have arrived in their order."""
    with tempfile.TemporaryDirectory() as folder:
        shore = Shore(Path(folder), caches)
        for number, name, part in copies:
            shore.arrive(name, whole[number][: round(part * len(whole[number]))])
        result = shore.result()
        (glider,) = shore.store.gliders()
        segments, _ = shore.store.extent(glider)
        shore.store.close()
    assert segments == len(whole), "lost, or counted twice"
    return result


def clean(n: int) -> list[Copy]:
    """Each file once, whole, in the order of time."""
    return [(number, f"{number:08d}.sbd", 1.0) for number in range(n)]


@st.composite
def disorder(draw: st.DrawFn, n: int) -> list[Copy]:
    """Whole copies in any order; cut ones before or after them, under the same name or another one."""
    rest: list[Copy] = []
    for _ in range(draw(st.integers(0, n))):
        number = draw(st.integers(0, n - 1))
        name = draw(st.sampled_from([f"{number:08d}.sbd", f"bruce-2024-121-0-{number}.sbd"]))
        rest.append((number, name, draw(st.sampled_from([0.0, 0.02, 0.3, 0.7, 0.999, 1.0]))))
    order = draw(st.permutations([*clean(n), *rest]))
    last = {name: part for _, name, part in order}
    # a name that was left cut is completed in the end, as a file that grows in place is
    return [
        *order,
        *((int(name[:8]), name, 1.0) for name, part in last.items() if name[0] == "0" and part < 1.0),
    ]


@pytest.fixture(scope="module")
def caches(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The cache files of the simulated mission."""
    folder = tmp_path_factory.mktemp("cache")
    write_cache(folder, MISSION)
    return folder


@pytest.fixture(scope="module")
def expected(caches: Path) -> Result:
    """What the clean order comes to."""
    found = ending(WHOLE, clean(len(WHOLE)), caches)
    assert len(found[0]) > 5
    assert found[1], "no incident: half of the comparison is of nothing"
    return found


@settings(max_examples=8)
@given(disorder(len(WHOLE)))
def test_any_order_of_files_ends_in_the_same(caches: Path, expected: Result, copies: list[Copy]) -> None:
    assert ending(WHOLE, copies, caches) == expected


@pytest.mark.parametrize("part", [0.1, 0.5, 0.95])
def test_every_file_cut_first_and_completed_later_newest_first(
    caches: Path, expected: Result, part: float
) -> None:
    cut = [(number, name, part) for number, name, _ in reversed(clean(len(WHOLE)))]
    assert ending(WHOLE, [*cut, *reversed(clean(len(WHOLE)))], caches) == expected


@pytest.mark.real
def test_files_of_a_real_mission_in_disorder(shared_data: Path) -> None:
    mission = shared_data / "electa-2022"
    files = sorted(mission.rglob("*.sbd"), key=lambda path: [int(x) for x in path.stem.split("-")[1:]])[:25]
    assert len(files) == 25
    caches = next(iter({path.parent for path in mission.rglob("*.c[ac]c")}))
    whole = [path.read_bytes() for path in files]
    rng = random.Random(5)
    cut = [(number, name, rng.choice([0.2, 0.6, 0.99])) for number, name, _ in clean(len(whole))]
    mixed = [*cut, *clean(len(whole))]
    rng.shuffle(mixed)
    finished = [*mixed, *clean(len(whole))]
    assert ending(whole, finished, caches) == ending(whole, clean(len(whole)), caches)
