"""What people read, and its delivery."""
