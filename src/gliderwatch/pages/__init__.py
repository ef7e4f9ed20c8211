"""Pages for pilots: what the state file holds, as whole HTML files that need nothing else."""
