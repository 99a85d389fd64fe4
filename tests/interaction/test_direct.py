"""The direct sum against the paper's definition and against what symmetry demands."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from numpy.typing import NDArray

from ellipsoid_coupling.errors import InputError
from ellipsoid_coupling.interaction import DirectInteraction
from ellipsoid_coupling.physics.potential import potential_shape

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

LENGTH = 0.05
H = 0.02


def paper_potential(
    delta: Complex, theta: complex, theta_bar: float, length: float, width: float
) -> complex:
    """U/eps0 as printed, `eq:interaction`: matrices and an inverse; complex arguments allowed."""
    long_axis, short_axis = 2.0 * length, 2.0 * width

    def gamma(angle: complex) -> Complex:
        axis = np.array([np.cos(angle), np.sin(angle)])
        return np.asarray(
            (long_axis**2 - short_axis**2) * np.outer(axis, axis) + short_axis**2 * np.eye(2)
        )

    factor = (long_axis**2 - short_axis**2) / (long_axis**2 + short_axis**2)
    amplitude = (1.0 - factor**2 * np.cos(theta - theta_bar) ** 2) ** -0.5
    s = delta @ np.linalg.inv(gamma(theta) + gamma(theta_bar)) @ delta
    if s.real >= 1.0:
        return 0.0
    return complex(amplitude * np.exp(-s / (1.0 - s)))


def paper_slopes(
    delta: Array, theta: float, theta_bar: float, length: float, width: float
) -> Array:
    """dU/dx, dU/dy, dU/dtheta of the first particle by complex steps: no difference is taken."""
    step = 1e-30j
    shifted = [(delta - step * np.eye(2)[axis], complex(theta)) for axis in range(2)]
    shifted.append((delta.astype(np.complex128), theta + step))
    values = [paper_potential(d, t, theta_bar, length, width) for d, t in shifted]
    return np.array([value.imag / abs(step) for value in values])


def random_fields(seed: int, ny: int, nx: int) -> tuple[Array, Array]:
    """A density with holes and any angles, (ny, nx)."""
    rng = np.random.default_rng(seed)
    density = np.where(rng.random((ny, nx)) < 0.7, rng.random((ny, nx)), 0.0)
    return density, rng.uniform(-9.0, 9.0, (ny, nx))


@pytest.mark.parametrize("aspect", [1.0, 2.0, 5.0])
def test_equals_the_papers_definition_summed_by_hand(aspect: float) -> None:
    # Round-off: the package's exp is good to 3e-14, the inverse costs as much at aspect ratio 5.
    ny, nx, width = 6, 9, LENGTH / aspect
    density, angle = random_fields(1, ny, nx)
    expected = np.zeros((3, ny, nx))
    for i, j in np.argwhere(density != 0.0):
        for k, m in np.argwhere(density != 0.0):
            delta = H * np.array([m - j, k - i])
            slopes = paper_slopes(delta, angle[i, j], angle[k, m], LENGTH, width)
            expected[:, i, j] -= 3.0 * H**2 * density[k, m] * slopes
    forces = DirectInteraction((ny, nx), H, potential_shape(LENGTH, width), 3.0)(density, angle)
    np.testing.assert_allclose(forces.x, expected[0], atol=1e-11 * np.abs(expected[:2]).max())
    np.testing.assert_allclose(forces.y, expected[1], atol=1e-11 * np.abs(expected[:2]).max())
    if aspect == 1.0:
        assert forces.torque is None
    else:
        assert forces.torque is not None
        np.testing.assert_allclose(forces.torque, expected[2], atol=1e-11 * np.ptp(expected[2]))


def test_momentum_is_kept() -> None:
    # The pair force is antisymmetric bit by bit; only the order of summation differs.
    density, angle = random_fields(2, 20, 17)
    forces = DirectInteraction((20, 17), H, potential_shape(LENGTH, 0.025), 1.0)(density, angle)
    for force in (forces.x, forces.y):
        assert abs(np.sum(density * force)) < 1e-13 * np.sum(np.abs(density * force))


def test_vacuum_feels_nothing_and_empty_fields_work() -> None:
    density, angle = random_fields(3, 8, 11)
    interaction = DirectInteraction((8, 11), H, potential_shape(LENGTH, 0.025), 1.0)
    for field in interaction(density, angle):
        assert field is not None
        assert np.all(field[density == 0.0] == 0.0)
    assert np.all(interaction(np.zeros((8, 11)), angle).x == 0.0)


def test_same_bits_on_one_and_two_threads() -> None:
    density, angle = random_fields(4, 30, 30)
    interaction = DirectInteraction((30, 30), H, potential_shape(LENGTH, 0.025), 1.0)
    before = numba.get_num_threads()
    results = []
    for threads in (1, min(2, before)):
        numba.set_num_threads(threads)
        results.append(interaction(density, angle))
    numba.set_num_threads(before)
    for one, two in zip(*results, strict=True):
        np.testing.assert_array_equal(one, two)


def test_turning_the_picture_turns_the_forces() -> None:
    # np.rot90 turns by +90 degrees where the y axis points up the rows, i.e. after a flip.
    density, angle = random_fields(5, 14, 14)
    interaction = DirectInteraction((14, 14), H, potential_shape(LENGTH, 0.025), 1.0)
    plain = interaction(density, angle)
    turned = interaction(np.rot90(density, -1).copy(), np.rot90(angle, -1) + 0.5 * np.pi)
    scale = np.abs(plain.x).max()
    np.testing.assert_allclose(turned.x, -np.rot90(plain.y, -1), atol=1e-12 * scale)
    np.testing.assert_allclose(turned.y, np.rot90(plain.x, -1), atol=1e-12 * scale)
    assert plain.torque is not None
    assert turned.torque is not None
    np.testing.assert_allclose(turned.torque, np.rot90(plain.torque, -1), atol=1e-12)


def test_fields_of_another_shape_are_refused() -> None:
    interaction = DirectInteraction((4, 5), H, potential_shape(LENGTH, 0.025), 1.0)
    with pytest.raises(InputError, match=r"expected density and angle of shape \(4, 5\)"):
        interaction(np.zeros((5, 4)), np.zeros((5, 4)))
    with pytest.raises(InputError, match="spacing"):
        DirectInteraction((4, 5), 0.0, potential_shape(LENGTH, 0.025), 1.0)
