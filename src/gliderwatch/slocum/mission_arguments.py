"""Mission arguments of a Slocum (`.ma` files) that an advice leads to: for pilots to check and send."""

from __future__ import annotations

from math import ceil, floor
from pathlib import Path

from gliderwatch.errors import GliderwatchError
from gliderwatch.fleet.advice import Advice
from gliderwatch.layers.advice import LayerAdvice
from gliderwatch.layers.band import Band
from gliderwatch.messages.formatting import utc


def goto_list(glider: str, field: str, t: float, advice: Advice) -> str:
    """The file of mission arguments that leads a Slocum to a waypoint (behavior `goto_list`), by the advice
    for a field to a glider that surfaced at `t` (s)."""
    return f"""behavior_name=goto_list
# Made by gliderwatch for {glider}, surfaced {utc(t)}. Check it before you send it.
# Field {field}: this leg takes {100 * advice.variance:.1f} % off the mean variance.
<start:b_arg>
    b_arg: num_legs_to_run(nodim)   -1
    b_arg: start_when(enum)          0
    b_arg: list_stop_when(enum)      7
    b_arg: initial_wpt(enum)         0
    b_arg: num_waypoints(nodim)      1
<end:b_arg>
<start:waypoints>
{_degrees_minutes(advice.lon)} {_degrees_minutes(advice.lat)}
<end:waypoints>
"""


def write_goto(glider: str, field: str, t: float, advice: Advice, outputs: Path) -> Path:
    """Write the mission argument (`goto_list`) into the folder of outputs; its path. Raises GliderwatchError
    where it cannot."""
    path = outputs / f"{glider}-{field.replace(' ', '_')}-goto.ma"
    try:
        _put(path, goto_list(glider, field, t, advice))
    except OSError as error:
        raise GliderwatchError(
            f"{path} cannot be written: {error.strerror}. Let the service write into the folder of "
            f"fields.{field}.advice.outputs, or name another"
        ) from None
    return path


def _degrees_minutes(value: float) -> str:
    """A coordinate (degrees) as a Slocum has it: degrees times 100, and minutes.

    >>> _degrees_minutes(-70.504166), _degrees_minutes(41.9999999)
    ('-7030.2500', '4200.0000')
    """
    minutes = round(abs(value) * 60, 4)
    sign = "-" if value < 0 else ""
    return f"{sign}{int(minutes // 60) * 100 + minutes % 60:.4f}"


def yo_arguments(glider: str, advice: LayerAdvice) -> dict[str, str]:
    """The files of mission arguments for a Slocum (behavior `yo`), by what they are of: the casts over all
    depths, and the band after them where there is one."""
    if advice.band is None:
        return {"full": _yo(glider, advice, advice.full, -1)}
    files = {"band": _yo(glider, advice, advice.band, -1)}
    if advice.full_casts:
        files["full"] = _yo(glider, advice, advice.full, advice.full_casts)
    return files


def _yo(glider: str, advice: LayerAdvice, band: Band, half_cycles: int) -> str:
    # Whole metres, away from the layer, but not out of the depths that may be flown.
    dive_to = min(ceil(band.bottom), floor(advice.full.bottom))
    climb_to = min(max(floor(band.top), ceil(advice.full.top)), dive_to)
    return f"""behavior_name=yo
# Made by gliderwatch for {glider}, after the segment until {utc(advice.t)}. Check it before you send it.
# {advice.mode.value}{": " + advice.why if advice.why else ""}
<start:b_arg>
    b_arg: start_when(enum)              2
    b_arg: num_half_cycles_to_do(nodim)  {half_cycles}
    b_arg: d_target_depth(m)             {dive_to}
    b_arg: d_target_altitude(m)          {ceil(advice.altitude)}
    b_arg: c_target_depth(m)             {climb_to}
<end:b_arg>
"""


def write_yo(glider: str, advice: LayerAdvice, outputs: Path) -> list[Path]:
    """Write the mission arguments into the folder of outputs; their paths. What an earlier advice left there
    and this one does not have is removed. Raises GliderwatchError where it cannot."""
    files, written = yo_arguments(glider, advice), list[Path]()
    try:
        for name in ("full", "band"):
            path = outputs / f"{glider}-yo-{name}.ma"
            if name not in files:
                path.unlink(missing_ok=True)
                continue
            _put(path, files[name])
            written.append(path)
    except OSError as error:
        raise GliderwatchError(
            f"{outputs} cannot be written: {error.strerror}. Let the service write into the folder of "
            f"gliders.{glider}.layers.outputs, or name another"
        ) from None
    return written


def _put(path: Path, text: str) -> None:
    """Put a file in the place of an earlier one, ASCII as a glider reads it. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".tmp")
    part.write_text(text, encoding="ascii", errors="replace")
    part.replace(path)
