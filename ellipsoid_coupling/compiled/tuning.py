"""Numbers that were found by measuring, each with its unit and how; no result depends on one."""

# Cache lines: so many prefetches may be under way. Swept 10 .. 160 with the q-grid's sweeps, 150x150x60.
CACHE_LINES_AT_ONCE = 40

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
