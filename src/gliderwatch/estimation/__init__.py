"""The papers' estimator and its persistent state for one glider. Pure."""
