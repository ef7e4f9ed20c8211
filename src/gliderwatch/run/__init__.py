"""The shell: the daemon and the replay, two sources of events for one path."""
