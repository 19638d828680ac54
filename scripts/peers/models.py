"""Rigid models of the benchmark, written to files that every driver reads: by formula, or random from a seed.

A file holds in its first line gravity (3) and the velocity of a free body (angular 3, linear 3); then one line per link: parent (-1: world),
1 if its hinge is free and 0 if revolute, axis (3), position (3) and quaternion (w x y z) of the hinge on the parent, mass, centre of
mass (3), inertia (xx yy zz xy xz yz) about it, hinge position, rate, torque. A free body stands at the origin of its hinge frame.
"""
import dataclasses
import math

import numpy as np

GRAVITY = (0.0, 0.0, -9.81)
HUB_VELOCITY = (0.01, 0.02, 0.03, 0.1, 0.0, 0.0)


@dataclasses.dataclass
class Link:
    """One rigid body and the hinge that carries it; SI, body axes."""
    parent: int
    free: bool
    axis: tuple
    position: tuple
    quaternion: tuple
    mass: float
    center_of_mass: tuple
    inertia: tuple
    state: tuple = (0.0, 0.0, 0.0)


@dataclasses.dataclass
class Model:
    """Links in an order in which parents come first."""
    links: list
    gravity: tuple = GRAVITY
    hub_velocity: tuple = HUB_VELOCITY

    @property
    def hinges(self):
        """Links on revolute hinges, in order."""
        return [link for link in self.links if not link.free]

    def write(self, path):
        """Writes the file for the drivers."""
        rows = [(*self.gravity, *self.hub_velocity)]
        rows += [(link.parent, int(link.free), *link.axis, *link.position, *link.quaternion, link.mass, *link.center_of_mass, *link.inertia,
                  *link.state) for link in self.links]
        path.write_text("".join(" ".join(repr(float(x)) for x in row) + "\n" for row in rows))


def read(path):
    """The model of a file."""
    head, *rows = (tuple(map(float, line.split())) for line in open(path))
    links = [Link(int(r[0]), bool(r[1]), r[2:5], r[5:8], r[8:12], r[12], r[13:16], r[16:22], r[22:25]) for r in rows]
    return Model(links, head[:3], head[3:])


def _arm_link(parent, k, x, yaw, hinge):
    state = (0.3 * math.sin(hinge + 1), 0.2 * math.cos(2 * hinge + 1), 0.1 * math.sin(3 * hinge + 2))
    return Link(parent, False, (0.0, 1.0, 0.0) if k % 2 else (0.0, 0.0, 1.0), (x * math.cos(yaw), x * math.sin(yaw), 0.0),
                (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)), 1.0, (0.25, 0.0, 0.0), (0.002, 0.022, 0.022, 0.0, 0.0, 0.0), state)


def chain(n):
    """n links from the world, each turning about y or z in turn."""
    return Model([_arm_link(k - 1, k, 0.5 if k else 0.0, 0.0, k) for k in range(n)])


def tree(n):
    """A free hub and four arms of n links."""
    links = [Link(-1, True, (0.0, 0.0, 1.0), (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), 10.0, (0.0,) * 3, (1.0, 1.2, 1.4, 0.0, 0.0, 0.0))]
    for arm in range(4):
        for k in range(n):
            links.append(_arm_link(len(links) - 1 if k else 0, k, 0.5, 0.0 if k else arm * math.pi / 2, len(links) - 1))
    return Model(links)


def random_tree(seed, count):
    """`count` links with random parents, axes, frames, masses, inertias and states; a free base for every other seed."""
    random = np.random.default_rng(seed)

    def unit(size):
        vector = random.standard_normal(size)
        return tuple(vector / np.linalg.norm(vector))

    def link(k):
        free = k == 0 and seed % 2 == 0
        # inertia of a cloud of points, so that it is one
        points = random.uniform(-0.3, 0.3, (4, 3))
        mass = random.uniform(0.5, 5.0)
        moments = mass / 4 * points.T @ points
        inertia = np.trace(moments) * np.eye(3) - moments
        # an ordinary tree: most links go on from one of the last few
        parent = max(-1, k - 1 - int(random.integers(0, 4))) if k else -1
        frame = ((0.0,) * 3, (1.0, 0.0, 0.0, 0.0)) if free else (tuple(random.uniform(-0.5, 0.5, 3)), unit(4))
        parts = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        state = (random.uniform(-math.pi, math.pi), random.uniform(-1, 1), random.uniform(-1, 1))
        return Link(max(parent, 0) if k else -1, free, unit(3), *frame, mass, tuple(random.uniform(-0.3, 0.3, 3)), tuple(parts), state)

    hub_velocity = tuple(random.uniform(-1, 1, 6))
    return Model([link(k) for k in range(count)], hub_velocity=hub_velocity)
