"""Between the file system and a decoded `model.Segment`."""
