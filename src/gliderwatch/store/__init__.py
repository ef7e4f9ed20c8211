"""The one state file: SQLite, written in one transaction per input."""
