"""How soon and how surely faults are detected, and how often a healthy glider is called faulty."""
