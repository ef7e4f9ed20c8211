"""What tests of alerts share: a dive, an incident and an alert as on a real mission; an outbox in memory."""

import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from gliderwatch.alerts.outbox import Delivery, OutboxRow
from gliderwatch.model import Alert, Assessment, Incident, Kind, Severity

DIVE = 1667639520.0  # 2022-11-05 09:12 UTC
SURFACE = 1667651640.0  # 2022-11-05 12:34 UTC

SLOW = Assessment(
    glider="electa",
    segment="electa-2022-308-3-2",
    t_dive=DIVE,
    t_surface=SURFACE,
    lat=24.20575,
    lon=-83.0205667,
    flag=1,
    reason="",
    speed=0.112,
    speed_min=0.22,
    speed_max=0.30,
    flow_u=0.15,
    flow_v=0.17,
    reference_u=0.13,
    reference_v=0.16,
    reference_final=True,
    p_e=0.031,
    gamma_f=0.3,
    clle_max=84.2,
    excitation=0.41,
    n_samples=812,
    evidence={
        "duration_h": 3.4,
        "ground_speed": 0.2,
        "along_speed": 0.115,
        "across_misfit": 0.008,
        "heading_steadiness": 0.93,
        "onboard_speed": 0.24,
        "depth_max": 182.0,
        "pitch_dive": -0.45,
        "pitch_climb": 0.30,
        "roll_mean": 0.31,
        "depth_rate_dive": 0.17,
        "depth_rate_climb": -0.08,
        "speed_before": 0.256,
    },
    notes=("magnetic declination from WMM2025",),
    parameters="p",
)
DISAGREE = replace(
    SLOW,
    flag=2,
    p_e=0.412,
    reference_u=-0.3,
    reference_v=-0.2,
    reference_final=False,
    evidence={"duration_h": 3.4, "across_misfit": 0.31, "onboard_speed": 0.24, "along_speed": 0.02},
)
HEALTHY = replace(SLOW, flag=0, speed=0.251, p_e=0.02, notes=(), evidence={"duration_h": 3.4})


def incident(worst: Assessment = SLOW, **changes: Any) -> Incident:
    made = Incident(
        id="electa/anomaly/1667639520",
        glider=worst.glider,
        kind=Kind.ANOMALY,
        severity=Severity.CRITICAL,
        since=DIVE,
        opened_at=SURFACE,
        cleared_at=None,
        dives=2,
        worst=worst,
        last=worst,
    )
    return replace(made, **changes)


def alert(alert_id: str = "a1", **changes: Any) -> Alert:
    made = Alert(
        id=alert_id,
        glider="electa",
        time=SURFACE,
        kind=Kind.ANOMALY,
        severity=Severity.CRITICAL,
        audience=Severity.CRITICAL,
        incident="electa/anomaly/1667639520",
        title="ANOMALY electa: 0.11 m/s through water (normal 0.22 to 0.30)",
        body="electa flies at 0.11 m/s.\nFlow: 0.23 m/s towards 041° true & <more>\n",
        html="<html><body><p>0.11 m/s, 041° true &amp; &lt;more&gt;</p></body></html>",
    )
    return replace(made, **changes)


def until(condition: Callable[[], bool], seconds: float = 5.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.002)


class MemoryStore:
    """The outbox as the protocol tells it, in memory; counts what is done to it, fails on request."""

    def __init__(self) -> None:
        self.rows: dict[int, OutboxRow] = {}
        self.next_try: dict[int, float] = {}
        self.done: dict[int, float] = {}
        self.errors: list[tuple[int, str, float]] = []
        self.given_up: dict[int, str] = {}
        self.marked: list[int] = []
        self.threads: set[int] = set()
        self.broken = 0
        self.opened = 0
        self.lock = threading.Lock()

    def open(self) -> "MemoryStore":
        self.opened += 1
        return self

    def add(self, alert: Alert, channel: str) -> int:
        with self.lock:
            row_id = len(self.rows) + 1
            self.rows[row_id] = OutboxRow(row_id, alert, channel, 0)
            self.next_try[row_id] = 0.0
        return row_id

    def _use(self) -> None:
        self.threads.add(threading.get_ident())
        if self.broken > 0:
            self.broken -= 1
            raise OSError("database is locked")

    def due(self, now: float) -> list[OutboxRow]:
        with self.lock:
            self._use()
            found, seen = [], set()
            for row in self.rows.values():
                if row.id in self.done:
                    continue
                key = (row.channel, row.alert.incident or f"row {row.id}")
                if key not in seen and self.next_try[row.id] <= now:
                    found.append(row)
                seen.add(key)
            return found

    def delivered(self, row_id: int, now: float) -> None:
        with self.lock:
            self._use()
            self.marked.append(row_id)
            self.done[row_id] = now

    def failed(self, row_id: int, error: str, next_try: float) -> None:
        with self.lock:
            self._use()
            if row_id in self.done:
                return
            row = self.rows[row_id]
            self.rows[row_id] = OutboxRow(row.id, row.alert, row.channel, row.attempts + 1)
            self.next_try[row_id] = next_try
            self.errors.append((row_id, error, next_try))

    def refused(
        self,
        row_id: int,
        delivery: Delivery,
        error: str,
        now: float,
        report: Alert | None,
        channels: Iterable[str],
    ) -> None:
        with self.lock:
            self._use()
            self.done[row_id] = now
            self.given_up[row_id] = error
            known = {(row.alert.id, row.channel) for row in self.rows.values()}
        for channel in channels if report is not None else ():
            if report is not None and (report.id, channel) not in known:
                self.add(report, channel)

    def park(self, row_id: int, error: str) -> None:
        with self.lock:
            self._use()
            self.next_try[row_id] = float("inf")
            self.errors.append((row_id, error, float("inf")))

    def adopt(self, channels: Iterable[str]) -> None:
        with self.lock:
            for row in self.rows.values():
                if row.channel in set(channels) and self.next_try[row.id] == float("inf"):
                    self.next_try[row.id] = 0.0

    def close(self) -> None:
        pass
