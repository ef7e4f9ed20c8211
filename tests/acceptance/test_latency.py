"""How long a pilot waits: from a file's last name to the mail that the server has accepted."""

from __future__ import annotations

import statistics
import time
from pathlib import Path

import pytest

from acceptance.support import Daemon, Site, healthy, mail_server, until
from gliderwatch.simulate.delivery import arrivals

WARM, MEASURED = 4, 50
LIMIT = 1.0


@pytest.mark.timing
def test_half_of_all_mails_are_accepted_within_a_second_of_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site = Site(tmp_path)
    mission = healthy(8.0)
    site.caches(mission)
    folder = site.folder("angus")
    files = list(arrivals(mission))[: WARM + MEASURED]
    assert len(files) == WARM + MEASURED
    seconds = []
    with mail_server() as box:
        site.configure("angus", url=box.url, surfacing=["angus"])
        with Daemon(site):
            for number, file in enumerate(files):
                came = len(box.mails)
                partial = folder / f".{file.name}.part"
                partial.write_bytes(file.data)
                begun = time.monotonic()
                partial.rename(folder / file.name)
                if number >= WARM:
                    until(lambda n=came: len(box.mails) > n, f"a mail for {file.name}")
                    seconds.append(box.mails[came].accepted - begun)
                else:
                    until(lambda name=file.name: name in site.files(), f"{file.name} taken")
                until(lambda: site.undelivered() == 0, "delivered")
    with capsys.disabled():
        print(f"\nfile to mail, s: {distribution(seconds)}")
    assert len(seconds) == MEASURED
    assert statistics.median(seconds) < LIMIT


def distribution(seconds: list[float]) -> str:
    """Least, quartiles and greatest of some times."""
    figures = [min(seconds), *statistics.quantiles(seconds, n=4), max(seconds)]
    names = ("min", "25 %", "median", "75 %", "max")
    return ", ".join(f"{name} {value:.3f}" for name, value in zip(names, figures, strict=True))
