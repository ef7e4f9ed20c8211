"""Layers of the sea in what gliders measured, and how deep to fly to keep on them (004). Pure."""
