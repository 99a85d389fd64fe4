"""Numbers that were found by measuring: the unit, what each trades, and how it was measured.

Found on two cores of one Xeon with AVX-512 by running the rows of `workflows/benchmark.py` that a number
touches. Where no figures stand beside a number it was chosen by such runs, of which none are on record.
Numbers of the first part change no bit of a result, as `tests/compiled/test_tuning.py` holds. Those of
the second part fix the order in which sums are added up, so that a change shows in the last digits.
"""

# --- no result depends on these ---

# Threads.
# Turns of the waiting loop, some 30 us: threads stay awake from one kernel to the next. To wake them
# takes 60 us, which small grids would pay at each loop; awake, a loop starts in 2 us.
SPINS = 2000
# Tasks that a thread has in all, where tasks differ in length, and at most at a time. More tasks
# balance better; more at a time save ways to the scheduler.
TASKS_PER_THREAD, MOST_TASKS_AT_ONCE = 16, 16
# Tasks that the rows of a grid are cut into, each with its own memory for one row: few enough for that
# memory to be small, enough of them to balance.
ROW_TASKS = 64
# Cells a thread must have to be worth waking (100 us of `diagnostics`).
CELLS_PER_THREAD = 100_000

# Cache lines.
# Prefetches under way at once. Swept 10 .. 160 with the q-grid's sweeps, 150x150x60.
CACHE_LINES_AT_ONCE = 40
# Lines by which `sum_products` prefetches a stream of factors ahead, 8 kB: less, and it waits for
# memory; more, and lines are evicted before they are read.
LINES_AHEAD = 128
# Cells between two rows from which on the second one is prefetched: hardware prefetch reads on by
# itself over shorter gaps (two lines of doubles).
FAR_CELLS = 16

# Sweeps.
# Columns of cells that march together. Many, since hardware prefetch works in each row; fewer where a
# grid has fewer than MANY_LINES rows of bundles, so that threads can share them. 320 has twice the speed
# of 96 along the angle.
WIDE_BUNDLE, NARROW_BUNDLE, MANY_LINES = 320, 100, 16

# Sums in registers.
# Rows and cache lines of sums that `sum_rows` keeps in registers at a time: eight, since a fused
# multiply-add takes four cycles and two start in each.
SUM_ROWS, SUM_LINES = 4, 2

# Transforms and spectra.
# Frequencies ky whose blocks are summed before they are interleaved: 1 MB at most, in cache.
KY_AT_ONCE = 16
# Numbers in a part of a transform: 1 MB at most in double precision, complex, in cache.
TRANSFORM_NUMBERS = 60_000
# Distances of an angular series are cut into at most so many tasks.
SERIES_TASKS = 64

# Samples on nodes.
# Samples whose basis functions are written before the first is read: a vector load waits for all
# single numbers that were last stored there.
SAMPLES_AT_ONCE = 32
# Parts that samples are sorted and interpolated in, at most, and samples that a part has at least: to
# wake a thread takes as long as to sort, or to interpolate, those.
SAMPLE_PARTS, LEAST_SORTED, LEAST_INTERPOLATED = 32, 20_000, 2_500


# Samples, blocks: with fewer in a few blocks a step takes no longer on one thread (a wake takes 30 us, a
# sample 10 ns), for which nothing more is to be compiled.
FEW_SAMPLES, FEW_BLOCKS = 2000, 8

# Steps of particles that a call of `advance` takes without noise. Between calls the monitors look at all
# particles, the forces included. Pair forces change within a few steps, so a call takes fewer.
# Measured with 128 x 1000 particles, `paper`: one look takes 2.0 % of the time of 32 steps, 1.3 % of 48.
PAIR_STEPS_PER_CALL, FREE_PARTICLE_STEPS_PER_CALL, MANY_FREE_PARTICLE_STEPS_PER_CALL = 16, 32, 48
# Particles: realisations with more than this in all do not fit into the second cache, from which they are
# stepped one by one; a look then reads memory.
MANY_FREE_PARTICLES = 30_000
# Steps of all samples that a call of `advance` takes without noise: progress is shown often enough.
SAMPLE_STEPS_PER_CALL = 8

# Ghost cells: to fill so many takes as long as to wake a thread.
GHOSTS_PER_THREAD = 4000

# Rows that the sweep along x is ahead of the one along y. The march along y begins two rows below its
# first one; at an edge these are ghosts, which follow from the first two rows. And a row that has just
# been written is not read at once.
ROWS_AHEAD = 3
# Strips of rows for each thread in a sweep along x and y, and the rows that a strip has at least: shorter
# ones copy and sweep more rows beside cuts than they gain. Swept on two threads, 150x150x60.
STRIPS_PER_THREAD, SHORTEST_STRIP = 2, 16


# --- these fix the order of sums: results depend on them in their last digits ---

# Particles from which on one realisation has all threads; below, realisations share the threads.
LARGE_CLOUD = 5000
# Particles a task of a large cloud has at least (0.7 ms of pair sums), and its tasks at most.
PARTICLES_PER_TASK, CLOUD_TASKS = 1250, 32
# Windows that samples are deposited in at most: each has its own rows of nodes, which are memory to go
# through; and samples that one has at least (to wake a thread takes as long as to deposit those).
DEPOSIT_WINDOWS, LEAST_DEPOSITED = 8, 2_500
# Lanes of `diagnostics` for sums over particles, which do not wait for each other; and the parts that
# realisations are cut into at most, and numbers that a part has at least (100 us, to wake a thread).
SURVEY_LANES, SURVEY_PARTS, NUMBERS_PER_PART = 256, 8, 100_000
