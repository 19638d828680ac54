"""Exudyn on the flexible system of the benchmark: `exudyn_peer.py FOLDER` answers `<panels> <modes> <solver> <h> <T>` with a JSON object.

A free rigid hub under a constant torque carries a chain of hinged panels (see panel.py, whose files are in FOLDER). Solvers: `implicit`,
its generalised-alpha method with its own defaults, and `dense`, the same with a dense linear solver. Its explicit solvers take no
joints, only stiff springs in their place, so that they solve another system; they are left out.
An interface is held by the corners of its face: the modes move the whole face as a rigid body.
"""
import json
import sys
import time
from pathlib import Path

sys.exudynFast = True  # the build without checks of indices
import exudyn  # noqa: E402
import exudyn.itemInterface as items  # noqa: E402
import numpy as np  # noqa: E402
import scipy.sparse  # noqa: E402
from exudyn.FEM import FEMinterface, ObjectFFRFreducedOrderInterface  # noqa: E402

HUB_MASS, HUB_INERTIA, HUB_HALF, LENGTH = 200.0, 50.0, 0.5, 2.0
TORQUE = [5.0, 20.0, 30.0]
STIFFNESS, DAMPING = 200.0, 2.0
MODAL_DAMPING = 5e-5
LINEAR_SOLVERS = {"implicit": "EigenSparse", "dense": "EXUdense"}
# turns z onto the hinge's axis y
ABOUT_Y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


class Panels:
    """Files of the panel, read once."""

    def __init__(self, folder):
        self.folder = folder
        with np.load(folder / "nodes.npz") as nodes:
            self.points, faces = nodes["points"], (nodes["root"], nodes["tip"])
        self.corners = [self._corners(face) for face in faces]
        self.mass, self.stiffness = (scipy.sparse.load_npz(folder / f"{name}.npz") for name in ("mass", "stiffness"))

    def _corners(self, face):
        spread = np.abs(self.points[face][:, 1:])
        return face[(spread > spread.max(axis=0) - 1e-6).all(axis=1)]

    def body(self, count):
        """The reduced body of `count` modes, which as many objects as wanted may share."""
        fem = FEMinterface()
        fem.nodes = {"Position": self.points}
        fem.massMatrix, fem.stiffnessMatrix = self.mass.tocsr(), self.stiffness.tocsr()
        with np.load(self.folder / f"panel_{count}.npz") as modes:
            fem.modeBasis, fem.eigenValues = {"matrix": modes["shapes"], "type": "HCBmodes"}, modes["squared"]
        return ObjectFFRFreducedOrderInterface(fem, rigidBodyNodeType="NodeType.RotationEulerParameters")


def build(panels, count, modes):
    """The system and its sensors."""
    system = exudyn.SystemContainer().AddSystem()
    inertia = exudyn.rigidBodyUtilities.RigidBodyInertia(HUB_MASS, HUB_INERTIA * np.eye(3))
    hub = system.CreateRigidBody(inertia=inertia, nodeType=exudyn.NodeType.RotationEulerParameters, returnDict=True)
    system.AddLoad(items.LoadTorqueVector(markerNumber=system.AddMarker(items.MarkerNodeRigid(nodeNumber=hub["nodeNumber"])), loadVector=TORQUE))

    def on_hub(turn):
        return system.AddMarker(items.MarkerBodyRigid(bodyNumber=hub["bodyNumber"], localHT=exudyn.HT(turn, [HUB_HALF, 0.0, 0.0])))

    def on_face(body, face, turn):
        corners = panels.corners[face]
        return system.AddMarker(items.MarkerSuperElementRigid(
            bodyNumber=body, meshNodeNumbers=corners, weightingFactors=np.full(len(corners), 1 / len(corners)), localHT=exudyn.HT(turn, [0.0, 0.0, 0.0])))

    reduced = panels.body(modes)
    outer, joints = [on_hub(np.eye(3)), on_hub(ABOUT_Y)], []
    for k in range(count):
        body = reduced.AddObjectFFRFreducedOrder(
            system, positionRef=[HUB_HALF + k * LENGTH, 0.0, 0.0], stiffnessProportionalDamping=MODAL_DAMPING)["oFFRFreducedOrder"]
        inner = [on_face(body, 0, np.eye(3)), on_face(body, 0, ABOUT_Y)]
        joints.append(system.AddObject(items.GenericJoint(markerNumbers=[outer[0], inner[0]], constrainedAxes=[1, 1, 1, 1, 0, 1])))
        system.AddObject(items.TorsionalSpringDamper(markerNumbers=[outer[1], inner[1]], stiffness=STIFFNESS, damping=DAMPING))
        outer = [on_face(body, 1, np.eye(3)), on_face(body, 1, ABOUT_Y)]
    kinds = exudyn.OutputVariableType
    sensors = {
        "tip": items.SensorMarker(markerNumber=outer[0], outputVariableType=kinds.Position),
        "hub": items.SensorNode(nodeNumber=hub["nodeNumber"], outputVariableType=kinds.RotationMatrix),
        "force": items.SensorObject(objectNumber=joints[0], outputVariableType=kinds.ForceLocal),
        "torque": items.SensorObject(objectNumber=joints[0], outputVariableType=kinds.TorqueLocal),
    }
    sensors = {name: system.AddSensor(sensor) for name, sensor in sensors.items()}
    system.Assemble()
    return system, sensors


def run(panels, count, modes, solver, step, duration):
    """Integrates; the time is that of the integration alone."""
    system, sensors = build(panels, count, modes)
    settings = exudyn.SimulationSettings()
    settings.timeIntegration.endTime = duration
    settings.timeIntegration.numberOfSteps = steps = round(duration / step)
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = duration
    settings.linearSolver.solverType = getattr(exudyn.LinearSolverType, LINEAR_SOLVERS[solver])
    start = time.process_time()
    system.SolveDynamic(settings, solverType=exudyn.DynamicSolverType.GeneralizedAlpha)
    cpu = time.process_time() - start
    shown = {name: np.ravel(system.GetSensorValues(sensor)).tolist() for name, sensor in sensors.items()}
    return {"m": count, "n": modes, "solver": solver, "h": step, "T": duration, "cpu": cpu, "steps": steps, **shown}


def main():
    """Answers requests until the input ends; one that fails gets an object with `error`."""
    panels = Panels(Path(sys.argv[1]))
    for line in sys.stdin:
        count, modes, solver, step, duration = line.split()
        try:
            answer = run(panels, int(count), int(modes), solver, float(step), float(duration))
        except Exception as error:  # whatever the engine raises
            answer = {"error": str(error)[:300]}
        print(json.dumps(answer), flush=True)


main()
