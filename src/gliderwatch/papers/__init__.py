"""The exact algorithms of the papers. Pure."""
