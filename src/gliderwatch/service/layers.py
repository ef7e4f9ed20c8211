"""The layers of gliders whose settings ask for them: learnt from each segment, with advice for the next."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, floor, inf
from pathlib import Path

from gliderwatch.config import Config
from gliderwatch.errors import GliderwatchError
from gliderwatch.layers.advice import LayerAdvice, LayerParams, after
from gliderwatch.layers.band import Band, Method, Tracking
from gliderwatch.messages.formatting import utc
from gliderwatch.model import SegmentId
from gliderwatch.service.outputs import put
from gliderwatch.store.state_file import Store


@dataclass(frozen=True, slots=True)
class GliderLayers:
    """What a glider is to do about layers; ``outputs`` is the folder for advice, None: none is wanted."""

    params: LayerParams
    outputs: Path | None = None


def layers_of(config: Config, glider: str) -> GliderLayers | None:
    """The settings of a glider; None where layers are off."""
    known = config.gliders.get(glider.lower())
    setting = None if known is None else known.layers
    if setting is None:
        return None
    params = LayerParams(
        setting.sensor,
        setting.max_depth,
        setting.min_depth,
        setting.altitude,
        Method(setting.method),
        setting.full_casts,
        setting.extension,
    )
    return GliderLayers(params, None if setting.outputs is None else Path(setting.outputs))


def wants_science(config: Config) -> bool:
    """Whether anything is to be made of science files: a field, or layers of a glider."""
    return bool(config.fields) or any(glider.layers is not None for glider in config.gliders.values())


def take(store: Store, identity: SegmentId, layers: GliderLayers) -> None:
    """Learn the layers of a segment that is held; inside of a transaction.

    What was learnt of another sensor counts for nothing.
    """
    before = store.layers.before(identity)
    known = before is not None and before.advice.sensor == layers.params.sensor
    tracking = before.tracking if before is not None and known else Tracking()
    store.layers.keep(identity, after(tracking, store.segments.get(identity), layers.params))


def newest(store: Store, glider: str, since: float = -inf) -> LayerAdvice | None:
    """The last advice to a glider, if it was given at `since` (s) or later."""
    found = store.layers.history(glider, 1)
    return found[0].advice if found and found[0].advice.t >= since else None


# ----------------------------------------
# The mission arguments of an advice: for a pilot to check and send.


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
            put(path, files[name])
            written.append(path)
    except OSError as error:
        raise GliderwatchError(
            f"{outputs} cannot be written: {error.strerror}. Let the service write into the folder of "
            f"gliders.{glider}.layers.outputs, or name another"
        ) from None
    return written
