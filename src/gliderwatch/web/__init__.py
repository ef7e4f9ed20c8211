"""The pages live, an API, and acknowledging from a phone: `gliderwatch web`."""
