"""Reference frequencies that share nothing with the solid model: Timoshenko beam and Mindlin plate by Legendre-Ritz,
uniform rods in closed form. The Ritz bases are converged to about 1e-6 of the frequencies quoted.
"""
import dataclasses

import numpy as np
from numpy.polynomial import Legendre
from numpy.polynomial.legendre import leggauss
from scipy.linalg import eigh


@dataclasses.dataclass(frozen=True)
class BeamSection:
    """Stiffnesses bending N m2 and shear N; mass per length kg/m and its rotary inertia kg m."""
    bending: float
    shear: float
    mass: float
    rotary: float


@dataclasses.dataclass(frozen=True)
class PlateSection:
    """Per area: bending N m, shear N/m, poisson_ratio, mass kg/m2 and rotary inertia kg."""
    bending: float
    shear: float
    poisson_ratio: float
    mass: float
    rotary: float


def timoshenko_frequencies(section, length, count, held):
    """Bending frequencies (count,) in Hz of a uniform beam, clamped at one end (held) or free. Ritz."""
    basis = _Polynomials(24, held, length)
    bending = section.bending * basis.gram(1, 1) + section.shear * basis.gram(0, 0)
    coupling = -section.shear * basis.gram(1, 0)
    zero = np.zeros_like(coupling)
    stiffness = np.block([[section.shear * basis.gram(1, 1), coupling], [coupling.T, bending]])
    mass = np.block([[section.mass * basis.gram(0, 0), zero], [zero, section.rotary * basis.gram(0, 0)]])
    return _frequencies(stiffness, mass, 0 if held else 2, count)


def mindlin_frequencies(section, length, width, count, edge):
    """Bending frequencies (count,) in Hz of a plate whose edge x = 0 is `clamped`, `rigid` (free to move as a rigid line)
    or `free`; the other edges are free. Ritz with deflection and two slopes."""
    along, across = _Polynomials(14, edge != "free", length), _Polynomials(14, False, width)
    size = along.count * across.count

    def gram(x_left, y_left, x_right, y_right):
        return np.kron(along.gram(x_left, x_right), across.gram(y_left, y_right))

    area, slope_xx, slope_yy = gram(0, 0, 0, 0), gram(1, 0, 1, 0), gram(0, 1, 0, 1)
    deflection_x, deflection_y = gram(1, 0, 0, 0), gram(0, 1, 0, 0)
    twist = (1 - section.poisson_ratio) / 2
    coupling = section.bending * (section.poisson_ratio * gram(1, 0, 0, 1) + twist * gram(0, 1, 1, 0))
    stiffness = np.block([
        [section.shear * (slope_xx + slope_yy), -section.shear * deflection_x, -section.shear * deflection_y],
        [-section.shear * deflection_x.T, section.bending * (slope_xx + twist * slope_yy) + section.shear * area, coupling],
        [-section.shear * deflection_y.T, coupling.T, section.bending * (slope_yy + twist * slope_xx) + section.shear * area]])
    zero = np.zeros((size, size))
    mass = np.block([[section.mass * area, zero, zero], [zero, section.rotary * area, zero], [zero, zero, section.rotary * area]])
    if edge == "rigid":
        stiffness, mass = _with_rigid_edge(stiffness, mass, section, along, across)
    return _frequencies(stiffness, mass, 0 if edge == "clamped" else 3, count)


def _with_rigid_edge(stiffness, mass, section, along, across):
    """Adds heave, pitch and roll of the whole plate to a clamped basis: no strain energy, coupled through the mass."""
    x, y, x_weight, y_weight = along.points, across.points - across.length / 2, along.weights, across.weights
    one_x, one_y = np.ones_like(x), np.ones_like(y)
    # (deflection, slope about y, slope about x) of each rigid motion, as products of a function of x and one of y.
    motions = [((one_x, one_y), None, None), ((x, one_y), (one_x, one_y), None), ((one_x, y), None, (one_x, one_y))]
    density = (section.mass, section.rotary, section.rotary)
    columns, rigid = [], np.zeros((3, 3))
    for index, motion in enumerate(motions):
        parts = [np.zeros(along.count * across.count) if field is None else
                 weight * np.kron(along.values[0] @ (x_weight * field[0]), across.values[0] @ (y_weight * field[1]))
                 for field, weight in zip(motion, density)]
        columns.append(np.concatenate(parts))
        for other, second in enumerate(motions):
            rigid[index, other] = sum(weight * np.sum(x_weight * a[0] * b[0]) * np.sum(y_weight * a[1] * b[1])
                                      for a, b, weight in zip(motion, second, density) if a is not None and b is not None)
    cross = np.column_stack(columns)
    padding = ((0, 3), (0, 3))
    return np.pad(stiffness, padding), np.block([[mass, cross], [cross.T, rigid]])


def rod_frequencies(wave_speed, length, count, held):
    """Axial or torsional frequencies (count,) in Hz of a uniform rod, fixed at one end (held) or free."""
    order = np.arange(1, count + 1)
    return wave_speed / (2 * length) * (order - 0.5 if held else order)


def rectangle_torsion_constant(width, thickness):
    """Saint-Venant torsion constant in m4 of a solid rectangle, by its series."""
    long, short = max(width, thickness), min(width, thickness)
    odd = np.arange(1, 60, 2)
    series = np.sum(np.tanh(odd * np.pi * long / (2 * short)) / odd ** 5.0)
    return long * short ** 3 * (1 / 3 - 64 / np.pi ** 5 * short / long * series)


def rectangle_shear_factor(poisson_ratio):
    """Cowper's shear factor of a rectangular section."""
    return 10 * (1 + poisson_ratio) / (12 + 11 * poisson_ratio)


class _Polynomials:
    """Legendre polynomials on [0, length], times x / length where the end x = 0 is held; values and first derivatives."""

    def __init__(self, count, held, length):
        nodes, weights = leggauss(count + 4)
        unit = (nodes + 1) / 2
        self.count, self.length, self.points, self.weights = count, length, unit * length, weights * length / 2
        factor = Legendre([0.5, 0.5], domain=[0, 1]) if held else Legendre([1.0], domain=[0, 1])
        polynomials = [factor * Legendre.basis(degree, domain=[0, 1]) for degree in range(count)]
        self.values = np.array([[polynomial(unit) for polynomial in polynomials],
                                [polynomial.deriv()(unit) / length for polynomial in polynomials]])

    def gram(self, left, right):
        """(count,count) integrals of the products of derivatives of orders `left` and `right` (0 or 1)."""
        return np.einsum("iq,jq,q->ij", self.values[left], self.values[right], self.weights)


def _frequencies(stiffness, mass, rigid_count, count):
    squared = eigh(stiffness, mass, eigvals_only=True)
    return np.sqrt(squared[rigid_count:rigid_count + count]) / (2 * np.pi)
