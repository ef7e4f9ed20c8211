"""The science file of a segment: from it comes the pressure that a flight file leaves out.

A glider writes tbd, nbd and ebd beside sbd, mbd and dbd, with the sensors of its science computer.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import gsw
import numpy as np

from gliderwatch.errors import GliderwatchError
from gliderwatch.model import EMPTY, Array, Series, readonly
from gliderwatch.slocum import folders
from gliderwatch.slocum.caches import candidates, read_list
from gliderwatch.slocum.header import Header
from gliderwatch.slocum.sensors import DEPTH, PRESSURES, Samples, depth_of


def science_files(flight: Path) -> Iterator[Path]:
    """The science files of the same name beside a flight file, plain or compressed."""
    return _beside(flight, folders.science_of(flight.name))


def flight_files(science: Path) -> Iterator[Path]:
    """The flight files of the same name beside a science file, plain or compressed."""
    return _beside(science, folders.flight_of(science.name))


def _beside(path: Path, suffixes: tuple[str, ...]) -> Iterator[Path]:
    for suffix in suffixes:
        for name in (f"{path.stem}.{suffix}", f"{path.stem}.{suffix.upper()}"):
            other = path.with_name(name)
            if other.is_file() and not other.is_symlink():
                yield other


def needs_science(header: Header, folders: Sequence[Path]) -> bool:
    """Whether the list of sensors of a flight file names nothing that tells the depth.

    False where the list is not known: then the file waits for it, or holds it, and is dealt with later.
    """
    with suppress(OSError):
        for path in candidates(header.crc, folders):
            with suppress(GliderwatchError, ValueError):
                _, sensors = read_list(path, header.crc)
                return set(sensors.names).isdisjoint((DEPTH, *PRESSURES))
    return False


# --------------------------------------------------------------------------- properties of the water

SCIENCE_TIME = "sci_m_present_time"
PRESSURE = PRESSURES[-1]
_TEMPERATURE, _CONDUCTIVITY = "sci_water_temp", "sci_water_cond"
_PLAUSIBLE = {PRESSURE: (-0.5, 200.0), _TEMPERATURE: (-3.0, 45.0), _CONDUCTIVITY: (0.01, 8.0)}
"""Bar, degree C, S/m: values outside are of a CTD that is off, in the air, or damaged."""


def sensors_of(property_name: str) -> tuple[str, ...]:
    """The science sensors that a property of the water is made of: `temperature` (degree C), `salinity`
    (practical), `density` (kg/m3, potential, less 1000), or the sensor of that name itself, as it is sent."""
    made_of = {
        "temperature": (_TEMPERATURE,),
        "salinity": (_TEMPERATURE, _CONDUCTIVITY),
        "density": (_TEMPERATURE, _CONDUCTIVITY),
    }
    return (PRESSURE, *made_of.get(property_name, (property_name,)))


def water(samples: Samples, property_name: str) -> dict[str, Series]:
    """Quantities ``science_depth`` (m) and ``science_`` with the name of the property (`sensors_of`), of the
    samples of a science file; none where it holds no such property.

    Salinity and density by TEOS-10 (gsw), with the absolute salinity of standard sea water: a gradient needs
    no better.
    """
    series = {name: _clean(samples, name) for name in sensors_of(property_name)}
    if not all(map(len, series.values())):
        return {}
    pressure = series[PRESSURE]
    value = series[sensors_of(property_name)[-1]]
    if property_name in ("salinity", "density"):
        value = _salty(pressure, series[_TEMPERATURE], value, property_name == "density")
    depth = Series(pressure.t, readonly(depth_of(pressure.v)))
    return {"science_depth": depth, f"science_{property_name}": value}


def _salty(pressure: Series, temperature: Series, conductivity: Series, density: bool) -> Series:
    """Practical salinity, or potential density less 1000 (kg/m3), at the times of the conductivity."""
    t = conductivity.t
    celsius = np.interp(t, temperature.t, temperature.v)
    decibar = 10.0 * np.interp(t, pressure.t, pressure.v)
    value: Array = gsw.SP_from_C(10.0 * conductivity.v, celsius, decibar)
    if density:
        absolute = gsw.SR_from_SP(value)
        value = gsw.sigma0(absolute, gsw.CT_from_t(absolute, celsius, decibar))
    good = np.isfinite(value)
    return Series(readonly(t[good]), readonly(value[good]))


def _clean(samples: Samples, name: str) -> Series:
    """The plausible samples of a sensor, one for each time, in order."""
    if name not in samples:
        return EMPTY
    t, v = samples[name]
    low, high = _PLAUSIBLE.get(name, (-np.inf, np.inf))
    with np.errstate(invalid="ignore"):
        good = np.isfinite(t) & np.isfinite(v) & (v >= low) & (v <= high)
    times, first = np.unique(t[good], return_index=True)
    return Series(readonly(times), readonly(v[good][first]))
