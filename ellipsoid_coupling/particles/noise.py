"""Gaussian noise: one counter-based stream per realisation, the same for any number of threads.

Realisation k of seed s has the Philox key that is spawned from s for k. Block b of its noise starts at
counter (0, 0, 0, b), so it can be drawn without the blocks before it. A resumed run therefore repeats
the bits of one that was never stopped.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Steps of noise in a block. Results depend on it: block b + 1 does not continue the numbers of block b.
STEPS_PER_BLOCK = 16

_START, _STEPS, _BIRTHS = range(3)


def _generator(seed: int, realisation: int, purpose: int, block: int) -> np.random.Generator:
    # A stream for each purpose: how many numbers the start takes changes no number of a step.
    sequence = np.random.SeedSequence(seed, spawn_key=(realisation, purpose))
    key = sequence.generate_state(2, np.uint64)
    return np.random.Generator(np.random.Philox(key=key, counter=[0, 0, 0, block]))


def start_positions(seed: int, realisation: int, number: int) -> NDArray[np.float64]:
    """Uniform numbers (2, number) in [0, 1) for the start of one realisation."""
    return _generator(seed, realisation, _START, 0).random((2, number))


def gaussian_block(
    seed: int, realisation: int, block: int, components: int, number: int
) -> NDArray[np.float64]:
    """Standard normal numbers (STEPS_PER_BLOCK, components, number) of one block of steps."""
    generator = _generator(seed, realisation, _STEPS, block)
    return generator.standard_normal((STEPS_PER_BLOCK, components, number))


def birth_stream(seed: int, realisation: int) -> np.random.Generator:
    """The numbers by which inlets feed particles into one realisation."""
    return _generator(seed, realisation, _BIRTHS, 0)
