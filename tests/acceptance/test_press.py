"""A phone takes an incident on: a real browser opens the link of a real mail and presses the button."""

from __future__ import annotations

import json
import re
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
from itsdangerous import URLSafeTimedSerializer

from acceptance.support import GLIDERWATCH, Daemon, Site, mail_server, remora, until
from gliderwatch.delivery import links
from gliderwatch.simulate.delivery import arrivals

DRIVER = shutil.which("chromedriver")
CHROMIUM = shutil.which("chromium")
pytestmark = pytest.mark.skipif(
    DRIVER is None or CHROMIUM is None, reason="no driver of Chromium: apt-get install chromium-driver"
)
PHONE = (360, 800)


@contextmanager
def phone() -> Iterator[Any]:
    """A browser with the window of a phone, which reaches this machine alone."""
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(str(DRIVER)))
    width, height = PHONE
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": True}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    try:
        yield driver
    finally:
        driver.quit()


def text_of(driver: Any) -> str:
    """What the page says, once it stands still: a live page loads itself again when something was added."""
    from selenium.common.exceptions import NoSuchElementException, StaleElementReferenceException

    while True:
        with suppress(NoSuchElementException, StaleElementReferenceException):
            return str(driver.find_element("tag name", "main").text)


def pressed(driver: Any, words: str) -> str:
    """What the next page says after the button of some words was pressed."""
    from selenium.common.exceptions import WebDriverException
    from selenium.webdriver.support.expected_conditions import staleness_of

    def is_left() -> bool:
        try:
            return bool(staleness_of(button)(driver))
        except WebDriverException as error:  # Chromium's word for it while the page changes
            if "does not belong to the document" in str(error):
                return True
            raise

    button = next((b for b in driver.find_elements("tag name", "button") if words in b.text), None)
    assert button is not None, f"no button {words}: {text_of(driver)}"
    button.click()
    until(is_left, "the page of the button is left")
    return text_of(driver)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def served(config: Path) -> Iterator[None]:
    """The pages, served live."""
    with subprocess.Popen([GLIDERWATCH, "web", "-c", config], stderr=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.terminate()


def answers(url: str) -> bool:
    """Whether pages are served."""
    with suppress(httpx.TransportError):
        return httpx.get(url, timeout=60).status_code == 200
    return False


@pytest.mark.slow  # test_web presses it by HTTP
def test_a_button_pressed_on_a_phone_stops_the_escalation(tmp_path: Path) -> None:
    mission, site, port = remora(2.2, onset=1.2), Site(tmp_path), free_port()
    site.caches(mission)
    url = f"http://127.0.0.1:{port}"
    with mail_server() as duty, mail_server() as chief, phone() as browser:
        site.configure("bruce")
        document = json.loads(site.config.read_text())
        document["channels"] = {"duty": {"url": duty.url}, "chief": {"url": chief.url}}
        document["recipients"] = {
            "pilot": {"channels": ["duty"]},
            "late": {"channels": ["chief"], "unacknowledged_minutes": 60},
        }
        document["web"] = {"port": port, "public_url": url}
        site.config.write_text(json.dumps(document))
        with Daemon(site), served(site.config):
            for file in arrivals(mission):
                site.put("bruce", file.name, file.data)
            until(lambda: duty.mails, "the pilot gets a mail")
            until(lambda: answers(url), "the pages are served")
            found = re.search(rf"{url}/ack/(\S+)", duty.mails[0].text)
            assert found is not None, duty.mails[0].text
            held = site.status()["held"]
            assert [one["unless_acknowledged"] for one in held] == [True]
            for bad in others(site, found[1]):
                browser.get(f"{url}/ack/{bad}")
                assert "This link" in text_of(browser)
                assert not browser.find_elements("tag name", "button")
            assert len(site.status()["held"]) == 1
            browser.get(found[0])
            assert "Take on bruce: anomaly since 20" in text_of(browser)
            assert len(site.status()["held"]) == 1  # opening it does nothing
            browser.find_element("name", "by").send_keys("Ann")
            assert "taken on by Ann (duty)" in pressed(browser, "I take it on")
            assert site.status()["held"] == []
            until(lambda: len(duty.mails) > 1, "the others are notified of who has it")
            browser.get(f"{url}/bruce.html")
            until(lambda: "Ann (duty) has it." in text_of(browser), "the live page loads itself again")
            browser.get(f"{url}/explore/bruce.html")
            until(lambda: "compared with" in text_of(browser), "Bokeh draws")
            browser.get(found[0])
            assert "bruce: muted until" in pressed(browser, "Mute it")
            assert site.status()["gliders"]["bruce"]["muted_until"] is not None
            assert [
                e for e in browser.get_log("browser") if e["level"] != "INFO" and e["source"] != "network"
            ] == []
        assert chief.mails == [] or all("ACKNOWLEDGED" in mail.subject.upper() for mail in chief.mails)


def others(site: Site, good: str) -> Iterator[str]:
    """Links that are not taken: forged, of another gliderwatch, expired."""
    key = links.key_of(site.state)
    incident, who = links.opened(key, good, 1e6)
    yield good[:-3] + "AAA"
    yield links.token("the-key-of-quite-another-gliderwatch", incident, who)

    class Earlier(URLSafeTimedSerializer):
        """Signs as if it were three days ago."""

    made = Earlier(key, salt="gliderwatch.acknowledge")
    signer = made.make_signer("gliderwatch.acknowledge")
    signer.get_timestamp = lambda: int(time.time()) - 3 * 86400  # type: ignore[method-assign]
    yield signer.sign(made.dump_payload([incident, who])).decode()
