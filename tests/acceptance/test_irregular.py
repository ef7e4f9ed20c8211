"""What is said, live and in a replay, of files that are wrong though the glider is well."""

from pathlib import Path

import pytest

from acceptance.irregular import GLIDER, about_files, clock_fallen, names_twice, said, two_gliders
from clocks import WEEKS

DAY = 86400.0


@pytest.mark.parametrize(
    ("seconds", "size"), [(WEEKS, "1024 weeks"), pytest.param(10 * DAY, "10 days", marks=pytest.mark.slow)]
)
def test_a_clock_that_falls_back_is_told_and_costs_nothing(tmp_path: Path, seconds: float, size: str) -> None:
    case = clock_fallen(seconds)
    found = said(case, tmp_path)
    title = f"the clock of {GLIDER} fell back by {size}"
    short = f"{GLIDER} CLOCK fell back by {size}"
    assert about_files([mail.subject for mail in found.mails]) == [short] == about_files(found.titles)
    assert title in found.status and "OVERDUE" not in found.status
    assert [mail.subject for mail in found.mails if "OVERDUE" in mail.subject] == []
    glider = found.details["gliders"][GLIDER]
    assert glider["dives"] >= len(case.mission.truth) - 1 and not glider["incidents"]
    assert glider["latest"]["segment"] in {s.header.full_name for s in case.mission.segments[-2:]}
    assert any("behind" in note for note in glider["latest"]["notes"])


@pytest.mark.slow
def test_names_that_are_used_twice_are_two_segments(tmp_path: Path) -> None:
    case = names_twice()
    found = said(case, tmp_path)
    assert found.details["files"] == {"taken": len(case.files)}
    assert found.details["gliders"][GLIDER]["segments"] == len(case.files)
    assert found.mails == [] and found.titles == []
    assert f"files: {len(case.files)} taken" in found.replayed


@pytest.mark.slow
def test_two_gliders_of_one_name_are_told(tmp_path: Path) -> None:
    found = said(two_gliders(), tmp_path)
    title = f"files of two gliders come under the name {GLIDER}"
    short = f"{GLIDER} TWO GLIDERS under this name"
    assert short in about_files([mail.subject for mail in found.mails])
    assert short in about_files(found.titles)
    assert title in found.status
    assert not [mail.subject for mail in found.mails if "SLOW" in mail.subject]
