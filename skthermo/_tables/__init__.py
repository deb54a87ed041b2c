"""Records as arrays and frames: how they are read, matched by name, given back, saved and put into text."""
