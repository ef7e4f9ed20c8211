"""The pages in a real browser, as a pilot sees them: on a phone and on a desk, with and without scripts."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from html import unescape
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from gliderwatch.figures.coast import world
from gliderwatch.messages.samples import SAMPLES
from gliderwatch.model import Kind
from gliderwatch.pages.render import Frame, field_page, fleet_page, glider_page, guide_page, sheet_page
from gliderwatch.pages.view import GliderView
from unit.test_field_page import view as field_view
from unit.test_pages import LATE, NOW, aborted, incident, view

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
SHOTS = Path(__file__).parents[2] / "build" / "screenshots"
PHONE, DESK = (360, 800), (1280, 800)

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium: apt-get install chromium")

LOOK = """<!DOCTYPE html><iframe id="f" src="{page}" width="{width}" height="{height}" {sandbox}
style="border:0"></iframe><pre id="told">nothing</pre><script>
document.getElementById("f").addEventListener("load", function () {{
  setTimeout(function () {{
    var inside = document.getElementById("f").contentDocument, root = inside.documentElement, first = [];
    inside.querySelectorAll("h1, h2, p, dt, dd").forEach(function (one) {{
      var box = one.getBoundingClientRect();
      if (box.height && box.bottom <= {height}) first.push(one.textContent);
    }});
    document.getElementById("told").textContent = JSON.stringify({{
      wide: root.scrollWidth, first: first.join(" "), stale: root.classList.contains("is-stale"),
      shown: getComputedStyle(inside.querySelector(".stale")).display,
      word: getComputedStyle(inside.querySelector(".word")).backgroundColor,
      small: Math.min.apply(null, Array.from(inside.querySelectorAll("p, dd, dt")).map(function (one) {{
        return parseFloat(getComputedStyle(one).fontSize); }}))
    }});
  }}, 300);
}});
</script>"""


@dataclass
class Served:
    """Pages on a port of this machine, and what was asked for."""

    folder: Path
    port: int = 0
    asked: list[str] = field(default_factory=list)

    def look(self, page: str, size: tuple[int, int], *, scripts: bool = True) -> dict[str, Any]:
        """What a browser makes of a page in a window of a size."""
        sandbox = "" if scripts else 'sandbox="allow-same-origin"'
        text = LOOK.format(page=page, width=size[0], height=size[1], sandbox=sandbox)
        (self.folder / "look.html").write_text(text)
        dom = browse("--dump-dom", f"http://127.0.0.1:{self.port}/look.html", "--virtual-time-budget=8000")
        told = re.search(r'<pre id="told">(.*?)</pre>', dom, re.DOTALL)
        assert told is not None, dom[-2000:]
        found: dict[str, Any] = json.loads(unescape(told[1]))
        return found

    def shoot(self, page: str, name: str, size: tuple[int, int]) -> Path:
        """A picture of the first screen of a page, in the output of the tests."""
        SHOTS.mkdir(parents=True, exist_ok=True)
        shot = SHOTS / f"{name}-{size[0]}.png"
        size_of = f'width="{size[0]}" height="{size[1]}" style="border:0"'
        frame = f'<iframe src="{page}" {size_of} sandbox="allow-same-origin"></iframe>'  # without scripts
        text = f'<!DOCTYPE html><body style="margin:0">{frame}'
        (self.folder / "shot.html").write_text(text)  # no window of the browser is as narrow as a phone
        url = f"http://127.0.0.1:{self.port}/shot.html"
        browse(f"--screenshot={shot}", f"--window-size={max(size[0], 500)},{size[1]}", url)
        return shot


def browse(*arguments: str) -> str:
    """Run the browser, which finds no other host."""
    command = [
        str(CHROMIUM),
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--hide-scrollbars",
        "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
        *arguments,
    ]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout


class Handler(SimpleHTTPRequestHandler):
    """Serves a folder, and notes what was asked for."""

    def __init__(self, *arguments: Any, served: Served, **more: Any) -> None:
        self.served = served
        super().__init__(*arguments, directory=str(served.folder), **more)

    def log_request(self, code: object = "-", size: object = "-") -> None:
        self.served.asked.append(self.path)

    def log_message(self, *_: object) -> None:
        pass


def fleet() -> tuple[GliderView, ...]:
    """One glider of each kind of trouble, and one that flies well."""
    alert = replace(SAMPLES[Kind.ANOMALY](NOW), incident="electa/anomaly/1")
    return (
        view(name="electa", incidents=(incident(),), alerts=(alert,), waypoint=(24.5, -82.9)),
        view(name="maria", awaited=LATE),
        view(name="unit_1033", notified=aborted()),
        view(name="george"),
    )


@contextmanager
def serving(folder: Path) -> Iterator[Served]:
    """A folder of pages on a port of this machine."""
    served = Served(folder)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Handler, served=served))
    served.port = server.server_address[1]
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield served
    finally:
        server.shutdown()


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("pages")
    frame = Frame(NOW, NOW + 900.0)
    (folder / "index.html").write_text(fleet_page(fleet(), frame, world()))
    (folder / "electa.html").write_text(glider_page(fleet()[0], frame, world()))
    (folder / "electa-sheet.html").write_text(sheet_page(fleet()[0], frame, world()))
    fresh = Frame(NOW, time.time() + 3600.0)
    (folder / "field.upper.html").write_text(field_page(field_view(), frame, world()))
    (folder / "fresh.html").write_text(fleet_page(fleet(), fresh, world()))
    with serving(folder) as served:
        yield served


@pytest.mark.parametrize("size", [PHONE, DESK])
@pytest.mark.parametrize("page", ["index.html", "electa.html", "electa-sheet.html"])
def test_a_page_fits_its_window_without_scripts_and_asks_nothing_else(
    served: Served, page: str, size: tuple[int, int]
) -> None:
    served.asked.clear()
    found = served.look(page, size, scripts=False)
    assert found["wide"] <= size[0]
    assert found["small"] >= 12.0
    assert found["word"] not in {"rgba(0, 0, 0, 0)", ""}  # the style is taken by the page's policy
    assert set(served.asked) <= {"/look.html", f"/{page}", "/favicon.ico"}
    shot = served.shoot(page, page.removesuffix(".html"), size)
    assert shot.read_bytes().startswith(b"\x89PNG")


def test_the_first_screen_of_a_phone_answers(served: Served) -> None:
    """Which glider, what, since, how sure, where, next, what to do: no tap."""
    found = served.look("electa.html", PHONE)
    for words in (
        "electa SLOW",
        "0.12 m/s through the water, normal is 0.20-0.32",
        "Nobody has it.",
        "What to do",
        "Last fix",
        "24° 12.600' N",
        "Next call",
    ):
        assert words in found["first"], (words, found["first"])
    first = served.look("index.html", PHONE)["first"]
    assert first.index("unit_1033 ABORTED") < first.index("maria OVERDUE")
    assert "4 gliders: 3 in trouble" in first


def test_a_page_marks_itself_stale_where_scripts_run(served: Served) -> None:
    late = served.look("index.html", PHONE)
    assert (late["stale"], late["shown"]) == (True, "block")
    fresh = served.look("fresh.html", PHONE)
    assert (fresh["stale"], fresh["shown"]) == (False, "none")
    still = served.look("index.html", PHONE, scripts=False)
    assert not still["stale"]
    assert "stale at 22:28" in (served.folder / "index.html").read_text().replace("\n", " ")


def test_the_guide_and_the_daily_sheet_fit_on_paper(served: Served, tmp_path: Path) -> None:
    (served.folder / "pilots.html").write_text(guide_page())
    for page, most in (("pilots.html", 2), ("electa-sheet.html", 1)):
        url, paper = f"http://127.0.0.1:{served.port}/{page}", tmp_path / "paper.pdf"
        browse(f"--print-to-pdf={paper}", "--no-pdf-header-footer", url)
        assert len(re.findall(rb"/Type /Page\b", paper.read_bytes())) == most, page


AXE = Path(__file__).parents[2] / "build" / "axe" / "axe.min.js"
JUDGE = """<pre id="told">nothing</pre><script src="axe.min.js"></script><script>
axe.run(document.querySelector("main")).then(function (found) {
  document.getElementById("told").textContent = JSON.stringify(found.violations.map(function (one) {
    return [one.id, one.nodes[0].html.slice(0, 200), one.nodes[0].failureSummary]; }));
});
</script></body>"""


@pytest.mark.skipif(not AXE.exists(), reason="no axe-core: .ci/run fetches it where npm is")
@pytest.mark.parametrize("page", ["index.html", "electa.html", "electa-sheet.html", "field.upper.html"])
def test_axe_finds_nothing_that_shuts_anybody_out(served: Served, page: str) -> None:
    shutil.copy(AXE, served.folder)
    text = re.sub(r'<meta http-equiv="Content-[^>]*>', "", (served.folder / page).read_text())
    (served.folder / "judged.html").write_text(text.replace("</body>", JUDGE))
    dom = browse("--dump-dom", f"http://127.0.0.1:{served.port}/judged.html", "--virtual-time-budget=15000")
    told = re.search(r'<pre id="told">(.*?)</pre>', dom, re.DOTALL)
    assert told is not None
    assert json.loads(unescape(told[1])) == []
