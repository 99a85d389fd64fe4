"""Files: open, check, limit, seal and write them; used by all other parts."""
