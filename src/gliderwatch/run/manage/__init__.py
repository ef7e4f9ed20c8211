"""What people do to the state by command, while the service runs: notes, copies, assessing anew."""
