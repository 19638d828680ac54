"""Drake under the line protocol of protocol.hpp, called from Python: a call costs what the op `overhead` measures besides.

fd = generalised accelerations of the plant after a new state; fdf = those and all reaction forces; overhead = the new state alone.
"""
import sys
import time

import numpy as np
from pydrake.math import RigidTransform
from pydrake.common.eigen_geometry import Quaternion
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, RevoluteJoint, SpatialInertia, UnitInertia

import models

BATCH = 5e-4


class Plant:
    """One model."""

    def __init__(self, path):
        model = models.read(path)
        plant = self.plant = MultibodyPlant(0.0)
        plant.mutable_gravity_field().set_gravity_vector(model.gravity)
        bodies, self.joints = [], []
        for number, link in enumerate(model.links):
            central = UnitInertia(*(x / link.mass for x in link.inertia))
            unit = central.ShiftFromCenterOfMass(link.center_of_mass)
            bodies.append(plant.AddRigidBody(f"body{number}", SpatialInertia(link.mass, link.center_of_mass, unit)))
            if link.free:
                self.joints.append(None)
                continue
            parent = bodies[link.parent].body_frame() if link.parent >= 0 else plant.world_frame()
            quaternion = np.array(link.quaternion) / np.linalg.norm(link.quaternion)
            frame = plant.AddFrame(FixedOffsetFrame(f"frame{number}", parent, RigidTransform(Quaternion(quaternion), link.position)))
            self.joints.append(plant.AddJoint(RevoluteJoint(f"joint{number}", frame, bodies[-1].body_frame(), link.axis)))
        plant.Finalize()
        self.context = plant.CreateDefaultContext()
        self.position, self.velocity = plant.GetPositions(self.context).copy(), np.zeros(plant.num_velocities())
        torque = np.zeros(plant.num_velocities())
        for link, joint in zip(model.links, self.joints):
            if joint is None:
                self.velocity[:6] = model.hub_velocity
                continue
            self.position[joint.position_start()], self.velocity[joint.velocity_start()], torque[joint.velocity_start()] = link.state
        plant.get_applied_generalized_force_input_port().FixValue(self.context, torque)
        self.acceleration = plant.get_generalized_acceleration_output_port()
        self.reaction = plant.get_reaction_forces_output_port()
        self.last = self.velocity[-1]

    def call(self, op, number):
        """One evaluation of an op that is timed."""
        self.velocity[-1] = self.last + 1e-12 * number
        self.plant.SetPositions(self.context, self.position)
        self.plant.SetVelocities(self.context, self.velocity)
        if op == "fdf":
            self.reaction.Eval(self.context)
        if op != "overhead":
            self.acceleration.Eval(self.context)

    def accelerations(self):
        """Of the revolute hinges."""
        self.call("fd", 0)
        values = self.acceleration.Eval(self.context)
        return [values[joint.velocity_start()] for joint in self.joints if joint is not None]

    def loads(self):
        """Six numbers per link: moment, force; zero for a free body."""
        self.call("fdf", 0)
        forces = self.reaction.Eval(self.context)
        of = lambda joint: np.zeros(6) if joint is None else forces[int(joint.index())].get_coeffs()
        return np.concatenate([of(joint) for joint in self.joints])


def timed(plant, op, seconds):
    """Least and median time of a call in ns, and the check."""
    batch, times, spent = 1, [], 0.0
    while spent < seconds or len(times) < 3:
        start = time.thread_time()
        for number in range(batch):
            plant.call(op, number & 7)
        taken = time.thread_time() - start
        spent += taken
        if taken < BATCH and not times:
            batch *= 2
        else:
            times.append(1e9 * taken / batch)
    return min(times), sorted(times)[len(times) // 2], sum(map(abs, plant.accelerations()))


def main():
    """Answers requests until the input ends."""
    held = plant = None
    for line in sys.stdin:
        path, _, op, seconds = line.split()
        if held != path:
            held, plant = path, Plant(path)
        if op in ("accelerations", "loads"):
            answer = getattr(plant, op)()
        elif op in ("fd", "fdf", "overhead"):
            answer = timed(plant, op, float(seconds))
        else:
            answer = ("skip",)
        print(*(x if isinstance(x, str) else repr(float(x)) for x in answer), flush=True)


main()
