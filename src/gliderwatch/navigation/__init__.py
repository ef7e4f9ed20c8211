"""From the samples of segments to dives: fixes, drift, tracks, depth-averaged currents. Pure."""
