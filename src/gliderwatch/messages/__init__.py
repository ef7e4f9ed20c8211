"""What people read: one structure of facts, rendered as title, text and HTML. Pure."""
