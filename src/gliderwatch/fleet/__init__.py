"""What many gliders know together: the fields they measure, the flow about them, where to look next. Pure."""
