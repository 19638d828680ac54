#!/usr/bin/env python3
"""Prints the computed reference values of the stability suite: coupled frequencies (S12) and energies of a spin that ends flat (S17)."""
from decimal import Decimal, getcontext

import numpy as np
from scipy.integrate import solve_ivp


def coupled_frequencies():
    """Hz: modes of 1e-3 to 1e6 Hz, each coupled by 0.3 to a free hinge with J = 1; roots of 1 + x d^2 sum 1 / (w_k^2 - x) by bisection."""
    getcontext().prec = 60
    tau = 2 * Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899862803482534211706798")
    squares = [(tau * Decimal(10) ** (k - 3)) ** 2 for k in range(10)]
    value = lambda x: 1 + x * Decimal("0.09") * sum(1 / (w - x) for w in squares)
    for k, square in enumerate(squares):
        low = square * (1 + Decimal(10) ** -30)
        high = (squares[k + 1] if k < 9 else 1000 * square) * (1 - Decimal(10) ** -30)
        for _ in range(190):
            middle = (low * high).sqrt()
            low, high = (middle, high) if value(middle) < 0 else (low, middle)
        yield low.sqrt() / tau


BUS_MASS, BUS_INERTIA = 10.0, np.diag([1.45, 4.26, 5.19])
TIP_MASS, TIPS = 0.5, np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
# mode, tip, component
SHAPES = np.array([[[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])


def rate(y, stiffness, damping):
    """Kane's equations of bus and tips; y holds angular velocity, modal coordinates, modal rates and the bus's velocity, body axes."""
    omega, eta, eta_dot, velocity = y[:3], y[3:5], y[5:7], y[7:]
    mass, force = np.zeros((8, 8)), np.zeros(8)
    mass[:3, :3], mass[3:6, 3:6] = BUS_MASS * np.eye(3), BUS_INERTIA
    force[3:6] = -np.cross(omega, BUS_INERTIA @ omega)
    force[6:] = -stiffness * eta - damping * eta_dot
    for tip, shape in zip(TIPS, SHAPES.transpose(1, 2, 0)):
        x, u = tip + shape @ eta, shape @ eta_dot
        turn = np.array([[0.0, x[2], -x[1]], [-x[2], 0.0, x[0]], [x[1], -x[0], 0.0]])
        partial = np.hstack([np.eye(3), turn, shape])
        bias = np.cross(omega, np.cross(omega, x)) + 2 * np.cross(omega, u)
        mass += TIP_MASS * partial.T @ partial
        force -= TIP_MASS * partial.T @ bias
    solved = np.linalg.solve(mass, force)
    return np.concatenate([solved[3:6], eta_dot, solved[6:], solved[:3] - np.cross(omega, velocity)])


def energy_and_momentum(y, stiffness):
    omega, eta, eta_dot, velocity = y[:3], y[3:5], y[5:7], y[7:]
    energy = 0.5 * (omega @ BUS_INERTIA @ omega + BUS_MASS * velocity @ velocity + stiffness * eta @ eta)
    momentum = BUS_INERTIA @ omega
    for tip, shape in zip(TIPS, SHAPES.transpose(1, 2, 0)):
        x = tip + shape @ eta
        speed = velocity + np.cross(omega, x) + shape @ eta_dot
        energy += 0.5 * TIP_MASS * speed @ speed
        momentum = momentum + TIP_MASS * np.cross(x, speed)
    return energy, np.linalg.norm(momentum)


def flat_spin(stiffness=200.0):
    damping = 2 * np.sqrt(stiffness)
    start = np.array([2.0, 0.3, 0.3, *[0.0] * 7])
    done = solve_ivp(lambda _, y: rate(y, stiffness, damping), (0, 1000), start, "DOP853", [0, 100, 400, 1000], rtol=1e-12, atol=1e-13)
    for time, y in zip(done.t, done.y.T):
        yield time, *energy_and_momentum(y, stiffness)


if __name__ == "__main__":
    for number, frequency in enumerate(coupled_frequencies(), 1):
        print(f"S12 mode {number}: {frequency:.22g} Hz")
    for time, energy, momentum in flat_spin():
        print(f"S17 after {time:.0f} s: {energy:.10f} J, {momentum:.12f} N m s")
