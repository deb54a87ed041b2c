"""Arguments and records as arrays and frames: read, matched by name, given back, saved and put into text."""
