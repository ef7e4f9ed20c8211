"""Missions that are over, by the hundred: judged again, in delayed mode, with reports; on one core or on many
machines."""
