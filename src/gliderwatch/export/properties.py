"""The properties of the sea that layers and fields are of, as their files call them. Pure."""

from __future__ import annotations

PROPERTIES = {
    "temperature": ("degree_Celsius", "sea_water_temperature"),
    "salinity": ("1", "sea_water_practical_salinity"),
    "density": ("kg m-3", "sea_water_sigma_theta"),
    "oxygen": ("umol l-1", "mole_concentration_of_dissolved_molecular_oxygen_in_sea_water"),
}
"""Unit and CF standard name of each; those of other sensors are not known."""
