"""Numbers that were found by measuring, each with its unit and how; no result depends on one."""

# Cache lines: so many prefetches may be under way. Swept 10 .. 160 with the q-grid's sweeps, 150x150x60.
CACHE_LINES_AT_ONCE = 40

# Ghost cells: to fill so many takes as long as to wake a thread.
GHOSTS_PER_THREAD = 4000

# Rows that the sweep along x is ahead of the one along y. The march along y begins two rows below its
# first one; at an edge these are ghosts, which follow from the first two rows. And a row that has just
# been written is not read at once.
ROWS_AHEAD = 3
# Strips of rows for each thread in a sweep along x and y, and the rows that a strip has at least: shorter
# ones copy and sweep more rows beside cuts than they gain. Swept on two threads, 150x150x60.
STRIPS_PER_THREAD, SHORTEST_STRIP = 2, 16
