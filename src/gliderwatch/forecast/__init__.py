"""Where and when a glider comes up next. Pure."""
