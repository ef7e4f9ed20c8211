"""From flags to incidents, and from incidents to what people are told. Pure."""
