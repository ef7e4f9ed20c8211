"""Stand-ins for what the process that draws does: it hangs, dies and fails, as drawing can."""

from __future__ import annotations

import os
import signal
import time

from gliderwatch.delivery.mail import Picture
from gliderwatch.service.mail_pictures import PictureJob, draw


def misbehave(job: PictureJob) -> tuple[Picture, ...]:
    """Does what the name of the glider says, else draws."""
    match job.glider:
        case "hangs":
            time.sleep(600)
        case "dies":
            os.kill(os.getpid(), signal.SIGKILL)
        case "fails":
            raise ValueError("cannot draw this")
    return draw(job)
