"""A simulated glider that writes genuine Dinkum files, with the truth beside them."""
