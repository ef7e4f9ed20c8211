"""What a pilot asks at night is answered on the first screen of a phone: electa, a fleet with three faults.

The page of all answers which, what, since when, who has it, and when each calls: no tap. Where it is, how
sure, why and what to do are on the glider's own page: one tap, no scrolling.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from acceptance.support import command
from acceptance.test_browser import CHROMIUM, DESK, PHONE, Served, serving

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt-get install chromium"),
]
DAYS = 2.3
SEA = ("--gliders", "4", "--days", str(DAYS), "--fault", "remora:8@1.2", "--seed", "4", "--logs")


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """sim-01 has a remora, sim-04 aborts; seven hours after all fell silent all but it are overdue."""
    folder = tmp_path_factory.mktemp("fleet")
    done = command("simulate", folder / "sea", *SEA, "--abort", "LEAK@1.5")
    assert done.returncode == 0, done.stderr
    done = command("run", "--replay", folder / "sea", "--out", folder / "out")
    assert done.returncode == 0, done.stderr
    state = ("--state", folder / "out" / "replay.sqlite")
    done = command("pages", *state, "--out", folder / "pages")
    assert done.returncode == 0, done.stderr
    as_of = re.search(r"As of <b>(\S+) (\S+) UTC", (folder / "pages" / "index.html").read_text())
    assert as_of is not None
    day, hour = as_of[1], int(as_of[2][:2])
    late = f"{day} {hour + 9:02d}:00" if hour < 14 else f"{day} 23:59"
    done = command("pages", *state, "--out", folder / "pages" / "late", "--at", late)
    assert done.returncode == 0, done.stderr
    with serving(folder / "pages") as served:
        yield served


QUESTIONS = {
    "which": r"{name}",
    "what": r"{name} {word}",
    "since when": r"Since ",
    "how sure": r"[Ss]ure \(\d+ %\)|it is the only one at sea|other gliders call",
    "where": r"\d+° \d\d\.\d{{3}}' [NS], \d{{3}}° ",
    "next call": r"(Next call|Was due) ?\d",
    "what to do": r"What to do",
}
GUIDE = Path(__file__).parents[2] / "docs" / "pages.md"


def taps(served: Served, name: str, word: str) -> list[str]:
    """For each question how many taps away its answer is, on the first screen of a phone without scripts."""
    fleet, own = (served.look(f"{page}.html", PHONE, scripts=False)["first"] for page in ("index", name))
    card = re.split(r"(?=sim-\d\d [A-Z]{4})", fleet.partition(f"{name} ")[2])[0]  # until that of the next
    found = []
    for pattern in QUESTIONS.values():
        one = re.compile(pattern.format(name=name, word=word))
        on_card, on_page = (one.search(text) for text in (f"{name} {card}", own))
        found.append("0" if on_card else "1" if on_page else "more")
    return found


def is_documented(row: list[str]) -> None:
    """The table of the documentation says so."""
    line = f"| {' | '.join(row)} |"
    assert line in GUIDE.read_text(), f"docs/pages.md has not: {line}"


def test_the_page_of_all_says_which_what_since_and_who(fleet: Served) -> None:
    first = fleet.look("index.html", PHONE, scripts=False)["first"]
    assert "4 gliders: 2 in trouble" in first
    assert first.index("sim-04 ABORTED") < first.index("sim-01 SLOW")
    for words in ("It fell out of its mission: LEAK. Since", "Nobody has it.", "Last call", "ago)"):
        assert words in first, (words, first)
    fleet.shoot("index.html", "fleet", DESK)
    fleet.shoot("index.html", "fleet", PHONE)


@pytest.mark.parametrize(
    ("name", "word", "more"),
    [
        ("sim-01", "SLOW", ("through the water, normal is", "Likeliest cause:", "95 % within", "Current")),
        ("sim-04", "ABORTED", ("It fell out of its mission: LEAK.", "95 % within", "Current")),
    ],
)
def test_a_page_of_a_glider_in_trouble_answers(
    fleet: Served, name: str, word: str, more: tuple[str, ...]
) -> None:
    is_documented([f"{name} {word}", *taps(fleet, name, word)])
    first = fleet.look(f"{name}.html", PHONE, scripts=False)["first"]
    for words in ("Nobody has it.", "Last fix", "Now about", *more):
        assert words in first, (words, first)
    fleet.shoot(f"{name}.html", name, PHONE)


def test_a_page_of_a_glider_that_stays_away_answers(fleet: Served) -> None:
    first = fleet.look("late/sim-02.html", PHONE, scripts=False)["first"]
    for words in ("sim-02 OVERDUE", "silent for", "Since", "Last fix", "Now about", "95 % within", "Was due"):
        assert words in first, (words, first)
    fleet.shoot("late/sim-02.html", "sim-02", PHONE)


@pytest.mark.real
def test_the_page_of_electa_overdue_answers(shared_data: Path, tmp_path: Path) -> None:
    """Its silence of nine hours on 9 November 2022."""
    done = command("run", "--replay", shared_data / "electa-2022", "--out", tmp_path / "out", timeout=200)
    assert done.returncode == 0, done.stderr
    state = ("--state", tmp_path / "out" / "replay.sqlite", "--at", "2022-11-09 22:30")
    done = command("pages", *state, "--out", tmp_path / "pages")
    assert done.returncode == 0, done.stderr
    with serving(tmp_path / "pages") as served:
        is_documented(["electa OVERDUE", *taps(served, "electa", "OVERDUE")])
        first = served.look("electa.html", PHONE, scripts=False)["first"]
        for words in ("silent for 7.8 h", "38.63959, -62.49869"):
            assert words in first, (words, first)
        served.shoot("electa.html", "electa", PHONE)
