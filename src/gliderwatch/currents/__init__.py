"""What the sea does at a glider: flow from the glider's own currents, and from files of a model. Pure."""
