"""Numbers that were found by measuring, each with its unit and how; no result depends on one."""

# Cache lines: so many prefetches may be under way. Swept 10 .. 160 with the q-grid's sweeps, 150x150x60.
CACHE_LINES_AT_ONCE = 40
