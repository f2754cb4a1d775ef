"""Legs on a trunk in Exudyn: 42 absolute coordinates a leg, exact joints, generalised alpha.

Every leg has the paper's 14 rigid bodies, 20 revolute joints and the lock, and a massless body for its
frame, which carries the pivot C and swings about O. A prescribed crank and its swing are functions of time;
with a motor the swing is a constraint between trunk, frame and crank, and the rotor a constant mass matrix
over frame and crank. The tolerances are tight, so that what remains is the error of the scheme, which falls
with the square of the step. Only the first sample's forces leave out what a swing that accelerates adds:
Exudyn starts without it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import exudyn as exu
import exudyn.itemInterface
import numpy as np
from numpy.typing import NDArray

from benchmarks.common import ALL, Outside, Record, Start
from hoof_env.constants import GRAVITY
from hoof_env.dynamics.parts import FREEDOMS, Limb, Motor, Trunk
from hoof_env.leg.link_tree import LinkTree
from hoof_env.leg.mechanism import FRAME
from hoof_env.leg.mechanism_list import PAPER

BODIES = PAPER.bodies
JOINTS = PAPER.joints
(LOCK,) = PAPER.welds

eii: Any = exudyn.itemInterface  # its types ask for protocols that closures do not meet by name

SPECTRAL_RADIUS = 0.6
"""Spectral radius of generalised alpha, below 1."""

SOLE = 13


class ExudynLegs:
    """Horse in Exudyn, ready to run once.

    Args:
        limbs, trunk: the horse.
        start: its first pose; each crank has the speed there, and keeps it or is driven to keep it.
        dt: time step [s].
        outside: forces at toe and heel; none if None. Called without `commit` within a step, with it after.
    """

    assembly: LinkTree = ALL

    def __init__(
        self,
        limbs: Sequence[Limb],
        trunk: Trunk,
        start: Start,
        dt: float = 1e-3,
        outside: Outside | None = None,
    ) -> None:
        self.limbs = tuple(limbs)
        self.trunk = trunk
        self.start = start
        self.dt = dt
        self.outside = outside
        self._container = exu.SystemContainer()
        self.mbs = self._container.AddSystem()
        self._reference: list[float] = []
        self._rows: dict[int, int] = {}  # rows of bodies among the coordinates
        self._ground = self.mbs.AddObject(eii.ObjectGround())
        self._still = self.mbs.AddMarker(
            eii.MarkerNodeCoordinate(nodeNumber=self.mbs.AddNode(eii.NodePointGround()), coordinate=0)
        )
        pose = (*start.position, 0.0)
        self._trunk = self._body(trunk.mass, trunk.pitch_inertia, pose, (0.0, 0.0, 0.0))
        self._hang()
        self._legs = [self._leg(i) for i in range(len(limbs))]
        self.mbs.Assemble()

    def run(self, duration: float, samples: int, fast: bool = False) -> Record:
        """Simulate `duration` [s] and look `samples` times after the beginning, evenly.

        `fast` is for timing: modified Newton and tolerances of 1e-6, which measured fastest.

        Raises:
            RuntimeError: Exudyn did not converge.
        """
        steps = round(duration / self.dt)
        every = steps // samples
        rows: list[tuple[Any, ...]] = []
        count = 0

        def after_step(mbs: Any, t: float) -> bool:
            nonlocal count
            if count and self.outside is not None:
                self._touch(t)
            if count % every == 0:
                rows.append(self._look(t))
            count += 1
            return True

        settings: Any = exu.SimulationSettings()
        time = settings.timeIntegration
        time.numberOfSteps = steps
        time.endTime = steps * self.dt
        time.verboseMode = 0
        time.generalizedAlpha.spectralRadius = SPECTRAL_RADIUS
        time.newton.useModifiedNewton = fast
        time.newton.absoluteTolerance = time.newton.relativeTolerance = 1e-6 if fast else 1e-10
        settings.solution.file.write = False
        settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
        if self.outside is not None:
            self._touch(0.0)
        self.mbs.SetPostStepUserFunction(after_step)
        if not self.mbs.SolveDynamic(settings):
            raise RuntimeError("Exudyn did not converge")
        return Record.of(rows)

    # The parts

    def _body(self, mass: float, inertia: float, pose: Sequence[float], rates: Sequence[float]) -> int:
        """Add a rigid body under its weight and return its number; all have three coordinates, in the order
        in which they are added."""
        self._reference += pose
        node = self.mbs.AddNode(
            eii.NodeRigidBody2D(referenceCoordinates=list(pose), initialVelocities=list(rates))
        )
        body = self.mbs.AddObject(eii.ObjectRigidBody2D(mass=mass, inertia=inertia, nodeNumber=node))
        self._rows[int(body)] = len(self._rows)
        if mass:
            marker = self.mbs.AddMarker(eii.MarkerBodyMass(bodyNumber=body))
            self.mbs.AddLoad(eii.LoadMassProportional(markerNumber=marker, loadVector=[0, -GRAVITY, 0]))
        return int(body)

    def _coordinate(self, body: int, axis: int) -> int:
        """Add a marker of one coordinate of a body; its value is the change since the start."""
        node = self.mbs.GetObjectParameter(body, "nodeNumber")
        return int(self.mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=node, coordinate=axis)))

    def _hold(self, one: int, two: int, offset: Callable[[float], float] | None = None) -> int:
        """Add a constraint: coordinate `two` less `one` is the offset."""
        law = {"offsetUserFunction": lambda mbs, t, item, _: offset(t)} if offset else {}
        return int(self.mbs.AddObject(eii.CoordinateConstraint(markerNumbers=[one, two], **law)))

    def _hang(self) -> None:
        """Add the supports of the trunk: constraints, drag, suspension."""
        trunk = self.trunk
        for axis in range(3):
            at = self._coordinate(self._trunk, axis)
            if axis >= FREEDOMS[trunk.kind]:  # each kind leaves free one more of x, y and pitch
                self._hold(self._still, at)
            elif axis == 0:
                self._spring(at, 0.0, trunk.drag, 0.0)
            elif axis == 1 and trunk.kind == "suspended":
                self._spring(at, trunk.stiffness, trunk.damping, trunk.height - self.start.position[1])
                total = trunk.mass + sum(limb.geometry.mass for limb in self.limbs)
                lift = (1 - trunk.share) * total * GRAVITY  # the rest of the animal's part of the weight
                self.mbs.AddLoad(eii.LoadCoordinate(markerNumber=at, load=lift))

    def _spring(self, at: int, stiffness: float, damping: float, offset: float) -> None:
        """Add a spring and a damper between the ground and a coordinate."""
        self.mbs.AddObject(
            eii.CoordinateSpringDamper(
                markerNumbers=[self._still, at], stiffness=stiffness, damping=damping, offset=offset
            )
        )

    def _point(self, body: int, x: float, y: float) -> int:
        """Add a marker of a point of a body."""
        return int(self.mbs.AddMarker(eii.MarkerBodyPosition(bodyNumber=body, localPosition=[x, y, 0])))

    def _leg(self, i: int) -> dict[str, Any]:
        """Add a leg: frame, bodies, joints, lock, drive, and forces from outside; return their numbers."""
        limb = self.limbs[i]
        start = self.start
        geometry = limb.geometry
        sigma = limb.geometry.travel
        pose = start.poses(self.limbs)[i]
        swing_rate = start.phi(i, start.crank[i])[1] * start.crank_speed[i]
        rates = (*pose.point_velocities[0], sigma * swing_rate)
        frame = self._body(0.0, 0.0, (*pose.point("O"), sigma * start.swing[i]), rates)
        bodies = [
            self._body(
                float(geometry.body_masses[k]),
                float(geometry.body_inertias[k]),
                (*pose.centres[k], pose.angles[k]),
                (*pose.centre_velocities[k], pose.angular_velocities[k]),
            )
            for k in range(len(BODIES))
        ]

        def local(k: int, point: str) -> tuple[float, float]:
            # The frame has its axes in the pose of the hip, bodies theirs at their centres of mass
            if k == FRAME:
                place = geometry.fixed[point]
                return (sigma * place.real, place.imag)
            out = complex(*(pose.point(point) - pose.centres[k])) * np.exp(-1j * pose.angles[k])
            return out.real, out.imag

        hip = [self._point(self._trunk, *limb.hip), self._point(frame, 0.0, 0.0)]
        self.mbs.AddObject(eii.ObjectJointRevolute2D(markerNumbers=hip))
        joints = []
        ends = []
        for joint in JOINTS:
            pair = [(frame if k == FRAME else bodies[k], local(k, joint.point)) for k in (joint.j, joint.i)]
            markers = [self._point(body, *at) for body, at in pair]
            joints.append(self.mbs.AddObject(eii.ObjectJointRevolute2D(markerNumbers=markers)))
            ends.append(pair)
        self._hold(self._coordinate(bodies[LOCK[1]], 2), self._coordinate(bodies[LOCK[0]], 2))

        axes = [self._coordinate(body, 2) for body in (self._trunk, frame, bodies[0])]
        is_motor = isinstance(limb.drive, Motor)
        drives = self._motor(i, frame, bodies[0], axes) if is_motor else self._prescribe(i, axes)
        half = geometry.body_lengths[SOLE] / 2
        corners = (-half, half) if geometry.toe == BODIES[SOLE].tail else (half, -half)
        if self.outside is not None:
            for point, x in enumerate(corners):
                markers = [self._point(self._ground, 0.0, 0.0), self._point(bodies[SOLE], x, 0.0)]
                law = {"springForceUserFunction": self._push(i, point)}
                self.mbs.AddObject(eii.CartesianSpringDamper(markerNumbers=markers, **law))
        return {"frame": frame, "bodies": bodies, "joints": joints, "ends": ends, "corners": corners} | drives

    def _prescribe(self, i: int, axes: list[int]) -> dict[str, Any]:
        """Add crank and swing as functions of time."""
        sigma = self.limbs[i].geometry.travel
        start = self.start
        theta = start.crank[i]
        speed = start.crank_speed[i]

        def swing(t: float) -> float:
            return sigma * (start.phi(i, theta + speed * t)[0] - start.swing[i])

        driver = self._hold(axes[1], axes[2], lambda t: -sigma * speed * t)
        return {"swing": self._hold(axes[0], axes[1], swing), "driver": driver}

    def _motor(self, i: int, frame: int, crank: int, axes: list[int]) -> dict[str, Any]:
        """Add a torque between frame and crank, the rotor, and the swing geared to the crank."""
        limb = self.limbs[i]
        sigma = self.limbs[i].geometry.travel
        start = self.start
        motor = limb.drive
        assert isinstance(motor, Motor)

        def torque(mbs: Any, t: float, item: int, u: float, v: float, *unused: float) -> float:
            """Return the torque on the crank, against the clock; Exudyn's force pulls marker 1 back."""
            return sigma * self._servo(i, -sigma * v)

        nodes = [self.mbs.GetObjectParameter(body, "nodeNumber") for body in (self._trunk, frame, crank)]
        self.mbs.AddObject(
            eii.CoordinateSpringDamper(markerNumbers=[axes[1], axes[2]], springForceUserFunction=torque)
        )
        # Turns of the rotor, by coordinate of trunk, frame and crank
        turns = np.array([0, 0, 0, 0, 0, 1 - motor.gear_ratio, 0, 0, motor.gear_ratio])
        rotor = self.mbs.AddObject(
            eii.ObjectGenericODE2(
                nodeNumbers=nodes,
                massMatrix=motor.rotor_inertia * np.outer(turns, turns),
                forceVector=np.zeros(9),
            )
        )
        # A held swing needs no gear
        if not start.swings:
            return {"swing": self._hold(axes[0], axes[1])}
        crank_at = self._reference[-3 * len(BODIES) + 2] - self._reference[-3 * len(BODIES) - 1]

        def swung(q: NDArray[np.float64]) -> tuple[float, float]:
            """Return the swing of the leg and its slope by the crank angle."""
            return start.phi(i, start.crank[i] - sigma * (q[8] - q[5] - crank_at))

        def error(mbs: Any, t: float, item: int, q: Any, q_t: Any, velocity: bool) -> list[float]:
            """Return the gap of the gear: swing of the frame against the trunk less the swing at the crank
            angle."""
            return [q[5] - q[2] - sigma * swung(q)[0]]

        def jacobian(mbs: Any, t: float, item: int, q: Any, q_t: Any, velocity: bool) -> Any:
            """Return the derivatives of the gap by the coordinates."""
            slope = swung(q)[1]  # sigma * d theta = d frame - d crank
            row = np.zeros((1, len(q)))
            row[0, [2, 5, 8]] = -1.0, 1.0 - slope, slope
            return row

        fixed = self.mbs.AddNode(eii.NodePointGround())
        markers = [
            self.mbs.AddMarker(eii.MarkerObjectODE2Coordinates(objectNumber=rotor)),
            self.mbs.AddMarker(eii.MarkerNodeCoordinates(nodeNumber=fixed)),
        ]
        gear = eii.CoordinateVectorConstraint(
            markerNumbers=markers,
            scalingMarker0=np.zeros((1, 9)),
            constraintUserFunction=error,
            jacobianUserFunction=jacobian,
        )
        return {"swing": int(self.mbs.AddObject(gear))}

    def _servo(self, i: int, speed: float) -> float:
        """Return the torque along theta [N m] of a motor with a crank that turns at `speed`."""
        motor: Any = self.limbs[i].drive
        asked = motor.speed_gain * (self.start.crank_speed[i] - speed)
        return float(np.clip(asked, -motor.torque_limit, motor.torque_limit))

    # The forces

    def _sole(self, body: int, x: float) -> tuple[complex, complex]:
        """Return position and velocity of a point on the sole."""
        values = [
            self.mbs.GetObjectOutputBody(body, kind, [x, 0, 0], exu.ConfigurationType.Current)
            for kind in (exu.OutputVariableType.Position, exu.OutputVariableType.Velocity)
        ]
        return complex(*values[0][:2]), complex(*values[1][:2])

    def _push(self, i: int, point: int) -> Callable[..., list[float]]:
        """Return the law of a connector, which Exudyn differentiates for Newton; its force pulls marker 1
        back."""

        def force(mbs: Any, t: float, item: int, at: Any, velocity: Any, *unused: Any) -> list[float]:
            assert self.outside is not None
            f = self.outside(i, point, t, complex(at[0], at[1]), complex(velocity[0], velocity[1]), False)
            return [-f.real, -f.imag, 0.0]

        return force

    def _touch(self, t: float) -> None:
        """Call the forces from outside at the end of a step, so that contacts latch."""
        assert self.outside is not None
        for i, leg in enumerate(self._legs):
            for point, x in enumerate(leg["corners"]):
                self.outside(i, point, t, *self._sole(leg["bodies"][SOLE], x), True)

    # What is to be seen

    def _look(self, t: float) -> tuple[Any, ...]:
        """Return the row of `Record` at the present instant."""
        system = self.mbs.systemData
        q = (np.array(self._reference) + system.GetODE2Coordinates()).reshape(-1, 3)
        v = np.array(system.GetODE2Coordinates_t()).reshape(-1, 3)
        tied = np.array(system.GetAECoordinates())
        row = self._rows
        rows = []

        def multiplier(item: int) -> Any:
            return -tied[list(system.GetObjectLTGAE(item))]

        def place(body: int, at: tuple[float, float]) -> complex:
            return complex(*q[row[body], :2]) + complex(*at) * np.exp(1j * q[row[body], 2])

        for i, (limb, leg) in enumerate(zip(self.limbs, self._legs, strict=True)):
            sigma = limb.geometry.travel
            frame = row[leg["frame"]]
            crank = row[leg["bodies"][0]]
            start = self._reference[3 * crank + 2] - self._reference[3 * frame + 2]
            theta = self.start.crank[i] - sigma * (q[crank, 2] - q[frame, 2] - start)
            speed = -sigma * (v[crank, 2] - v[frame, 2])
            swing = sigma * float(multiplier(leg["swing"])[0])
            if isinstance(limb.drive, Motor):
                torque = self._servo(i, speed)
            else:
                torque = -sigma * float(multiplier(leg["driver"])[0])
            gaps = [abs(place(*end_of_one) - place(*end_of_two)) for end_of_one, end_of_two in leg["ends"]]
            pins = np.array([multiplier(joint) for joint in leg["joints"]])
            rows.append((theta, speed, torque, swing, pins, max(gaps)))
        thetas, speeds, torques, swings, forces, widest = map(np.array, zip(*rows, strict=True))
        return t, thetas, speeds, np.concatenate([q[0], v[0]]), torques, swings, forces, widest.max()
