"""A fleet's files come, the daemon is started again whenever it ends, and faults come and go meanwhile."""

from __future__ import annotations

import heapq
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from itertools import count

import logbook

from acceptance.chaos import Chaos, hooked
from acceptance.disk import Disk
from acceptance.hostile import program
from acceptance.support import Mailbox, Site, until
from clocks import WEEKS, files_with_clock_set
from gliderwatch.simulate.glider import simulate
from gliderwatch.simulate.scenario import Fault, FaultKind, Mission, Scenario

Lane = Generator[float, None, None]
"""What goes on beside the rest: yields how long to wait (s), and puts all right when it is closed."""
Kind = tuple[str, Callable[[], Lane]]
"""A kind of fault: its name, and what makes it begin."""

DECODE_SECONDS = 5.0
CALM = 0.8
"""The part of the time after which the daemon is not killed any more: the last one lives through the rest."""
_RESTART = 1.0
_AFTERMATH = 60.0
"""Seconds after a fault of state or configuration within which a start may still fail by it."""


CLOCKS = {"ada": -5 * 3600.0, "emil": -WEEKS}
"""By how much (s) the clock of a healthy glider falls back, half way."""


def fleet(days: float) -> list[Mission]:
    """Six gliders: four with something that goes wrong on the way, two whose clock falls back."""
    day, start = 86400.0, Scenario().start
    wrong = [
        [],
        [Fault(FaultKind.REMORA, start + 0.4 * days * day, 8.0)],
        [Fault(FaultKind.WING_LOSS, start + 0.5 * days * day, 0.6)],
        [Fault(FaultKind.DAC_WRONG, start + 0.3 * days * day, 0.4)],
        [],
        [Fault(FaultKind.REMORA, start + 0.6 * days * day, 5.0)],
    ]
    names = ["ada", "bruce", "carol", "dora", "emil", "frida"]
    missions = [
        simulate(Scenario(seed=30 + number, glider=name, days=days, faults=tuple(faults)))
        for number, (name, faults) in enumerate(zip(names, wrong, strict=True))
    ]
    return [
        files_with_clock_set(mission, len(mission.segments) // 2, CLOCKS[name]) if name in CLOCKS else mission
        for name, mission in zip(names, missions, strict=True)
    ]


class SparedError(Exception):
    """A fault did not come about: it is not to, or cannot be, now."""


class Storm(Chaos):
    """A live feed over so many `seconds`, under faults; what they are and when follows from the seed."""

    def __init__(self, site: Site, seed: int, seconds: float, boxes: Mapping[str, Mailbox]) -> None:
        missions = fleet(max(2.0, seconds / 100.0))
        super().__init__(site, missions, seed, (sys.executable, "-c", program(DECODE_SECONDS)))
        self.gliders = [mission.scenario.glider for mission in missions]
        site.caches(*missions)
        self.seconds, self.boxes, self.begun = seconds, boxes, time.monotonic()
        self.disk = Disk(site.state.parent, megabytes=192)
        self.switches = {
            name: site.config.with_name(name.lower())
            for name in ("CHAOS_STATE", "CHAOS_CLOCK", "CHAOS_OBSERVER", "CHAOS_SLOW")
        }
        self.done: Counter[str] = Counter()
        self.wrong: list[str] = []
        self.is_away = self.is_harmed = False
        self._kill_at: str | None = None
        self._stopped: object = None
        self._excuses, self._excused_until = 0, 0.0
        self._holds, self._held_since = 0, 0.0
        self._start_at: float | None = 0.0

    def blow(self, lanes: Sequence[Lane]) -> None:
        """Let all lanes go on beside each other until the time is over, then let go of all faults."""
        order = count()
        due = [(self.begun, next(order), lane) for lane in lanes]
        while time.monotonic() < self.begun + self.seconds:
            self.supervise()
            at, _, lane = due[0]
            if at > time.monotonic():
                time.sleep(min(0.1, at - time.monotonic() + 0.001))
                continue
            heapq.heappop(due)
            with suppress(StopIteration):
                heapq.heappush(due, (next(lane) + time.monotonic(), next(order), lane))
        for lane in lanes:
            lane.close()

    def lane(self, least: float, most: float, kinds: Sequence[Kind]) -> Lane:
        """Each of some kinds of faults in turn, shuffled, with pauses of `least` to `most` seconds."""
        bag: list[Kind] = []
        while True:
            bag = bag or self.chance.sample(kinds, len(kinds))
            name, fault = bag.pop()
            yield self.chance.uniform(least, most)
            with suppress(SparedError):
                yield from fault()
                self.done[name] += 1

    def feed(self) -> Lane:
        """The files of the fleet, spread over the time."""
        while left := self.total - self.tally.files:
            self.put_if_there()
            rest = max(0.0, self.begun + 0.95 * self.seconds - time.monotonic())
            yield self.chance.uniform(0.0, 2.0) * rest / left

    def put_if_there(self) -> None:
        """The next file comes, unless the root is away."""
        if not self.is_away:
            self.put()

    def part(self) -> float:
        """How much of the time is over."""
        return (time.monotonic() - self.begun) / self.seconds

    def is_calm(self) -> bool:
        """Whether the daemon is not killed any more."""
        return self.part() > CALM

    # ------------------------------------------------------------------- daemon

    def supervise(self) -> None:
        """Start the daemon again when it has ended, as the service manager does; note why it ended."""
        if self.daemon.alive():
            return
        now = time.monotonic()
        if self._start_at is None:
            self._ended(now)
        elif now >= self._start_at:
            self._start_at = None
            kill = {} if self._kill_at is None else {"CHAOS_KILL": self._kill_at}
            self.daemon.env = hooked(**self.switches, **kill)
            self.daemon.start()

    def _ended(self, now: float) -> None:
        assert self.daemon.process is not None
        code, self._start_at = self.daemon.process.returncode, now
        if code == -signal.SIGKILL and self._kill_at is not None:
            self.tally.at.append(now)
            self.tally.kills["{} commit {}".format(*self._kill_at.split(":"))] += 1
            self._kill_at = None
        elif code == 2 and (self._excuses or now < self._excused_until):
            self.done["ended by itself with 2, started again"] += 1
            self.tally.at.append(now)
            self._start_at = now + _RESTART
        else:
            last = self.daemon.text().splitlines()[-1:]
            self.wrong.append(f"the daemon ended by itself with {code}: {last}")
            self._start_at = now + _RESTART

    def strike(self, why: str = "at a random moment", down: float = 0.0) -> None:
        """Kill the daemon, which stays `down` for so long (s)."""
        if not self.daemon.alive():
            return
        if not self.daemon.watches():
            why = "while it starts"
        self.daemon.kill()
        self.tally.at.append(time.monotonic())
        self.tally.kills[why] += 1
        self._start_at, self._kill_at = time.monotonic() + down, None

    def kill_at_commit(self, when: str, number: int) -> None:
        """The next daemon dies before or after one of its commits."""
        self._kill_at = f"{when}:{number}"

    def is_fatal(self) -> bool:
        """Whether this daemon is to die at a commit."""
        return self._kill_at is not None

    def terminate(self, down: float) -> bool:
        """End the daemon in order, which stays `down` for so long (s); whether there was one to end."""
        if self._is_stopped() or not self.daemon.alive():
            return False
        self.tally.at.append(time.monotonic())
        self.signal(signal.SIGTERM)
        with suppress(AssertionError):
            until(lambda: not self.daemon.alive(), "ended", 20.0)
        if self.daemon.alive():
            self.wrong.append("SIGTERM did not end the daemon within 20 s")
            self.daemon.kill()
        self.tally.at.append(time.monotonic())
        self._start_at, self._kill_at = time.monotonic() + down, None
        code = self.daemon.wait()
        if code not in (0, -signal.SIGTERM, -signal.SIGKILL) and not (code == 2 and self._excuses):
            self.wrong.append(f"the daemon ended with {code} after SIGTERM")
        return True

    def signal(self, number: int) -> None:
        """Send a signal to the daemon, if it lives."""
        assert self.daemon.process is not None
        self.daemon.process.send_signal(number)

    def is_ready(self) -> bool:
        """Whether there is a daemon that listens to signals."""
        return self.daemon.alive() and self.daemon.watches()

    @contextmanager
    def excused(self) -> Iterator[None]:
        """Meanwhile, and for a while, the daemon may end with 2: it cannot use its state or configuration."""
        self._excuses += 1
        try:
            yield
        finally:
            self._excuses -= 1
            self._excused_until = time.monotonic() + _AFTERMATH

    @contextmanager
    def held(self) -> Iterator[None]:
        """Meanwhile the daemon cannot mark what was accepted."""
        if not self._holds:
            self._held_since = time.monotonic()
        self._holds += 1
        try:
            yield
        finally:
            self._holds -= 1
            if not self._holds:
                self.tally.held.append((self._held_since, time.monotonic() + 4.0))

    @contextmanager
    def stopped(self) -> Iterator[None]:
        """Meanwhile the daemon does not run."""
        process = self.daemon.process
        assert process is not None
        if self._is_stopped():
            yield
            return
        self._stopped = process
        try:
            with self.daemon.stopped():
                yield
        finally:
            self._stopped = None

    def _is_stopped(self) -> bool:
        return self._stopped is not None and self._stopped is self.daemon.process

    # ------------------------------------------------------------------- to the end

    def clock(self) -> str:
        """The time since the start."""
        seconds = int(time.monotonic() - self.begun)
        return f"{seconds // 60:3d}:{seconds % 60:02d}"

    @contextmanager
    def ending(self) -> Iterator[None]:
        """Meanwhile the daemon may run; after that it does not, whatever happened."""
        try:
            yield
        finally:
            if self.daemon.alive():
                self.daemon.kill()

    def settle(self, is_named: Callable[[], bool]) -> None:
        """All faults are over: let the rest come, and the daemon do its work."""
        while self.put() is not None:
            pass
        for what, condition in (
            ("hostile files named", is_named),
            ("all files judged", self.is_settled),
            ("all delivered", lambda: self.site.undelivered() == 0),
        ):
            end = time.monotonic() + (patience := 1000.0)
            while not (self.is_ready() and condition()):
                self.supervise()
                if time.monotonic() > end:
                    self.wrong.append(f"not within {patience:g} s: {what}")
                    break
                time.sleep(0.5)

    def end(self) -> None:
        """The daemon has done its work."""
        if (code := self.daemon.stop()) != 0:
            self.wrong.append(f"the daemon ended with {code}")

    def complaints(self) -> list[str]:
        """What is wrong so far, each once."""
        found = [*self.wrong, *(f"a copy of the state is broken: {text}" for text in self.tally.broken)]
        return list(dict.fromkeys(found + logbook.complaints(self.daemon.text())))
