"""What is known of gliders for other programs: GeoJSON, KML, NetCDF, CSV, virtual AIS."""
