"""Is the speed abnormal, and can the estimate be believed? Pure."""
