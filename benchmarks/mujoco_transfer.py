"""The agent of HorseLeg-v0 drives the same leg in MuJoCo, through the model that `Geometry.to_mjcf` exports.

    python -m benchmarks.mujoco_transfer --out runs/transfer             needs the extra "peers"
    python -m benchmarks.mujoco_transfer --no-fit --film                 with the contact found before

Three numbers of MuJoCo's contact are fitted: stiffness, damping, and impedance at the surface. What they are
fitted to is the run alone, a scripted gait: its speed, its stance peaks and its return. The agent then acts
on what it would observe, 50 times a second. Crank and swing are MuJoCo's servos, whose commands pass the
filters of `hoof_env.gait`. Friction is the exported coefficient. Observation and reward are computed here
from MuJoCo's own motion and forces, by the rules of docs/task.md, substep by substep.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from agents import runs
from agents.command import run
from agents.score import find_policy, play
from hoof_env._output import check_folder, markdown_table
from hoof_env.constants import GRAVITY
from hoof_env.dynamics.memory import LIFT_OFF
from hoof_env.dynamics.observables import StanceCounter
from hoof_env.dynamics.parts import Motor
from hoof_env.envs.policies import start_of
from hoof_env.errors import count
from hoof_env.gait import INNER, PARAMETERS
from hoof_env.leg.kinematics import FrameMotion, pose
from hoof_env.leg.link_tree import CRANK_LINK, link_tree
from hoof_env.leg.mjcf import SWING_DAMPING, SWING_STIFFNESS
from hoof_env.tasks.observation import HALF_RANGE, MIDDLE
from hoof_env.tasks.reward import BEARING, LONGEST_STRIDE, STEPPING

Floats = NDArray[np.float64]

ENV_ID = "hoof_env/HorseLeg-v0"
POLICY = "agents/policies/HorseLeg-v0"
FIT_SEEDS = range(4_000_000, 4_000_002)
SEEDS = range(4_100_000, 4_100_020)
"""Episodes of the fit and of the comparison, on which nothing else is played."""

CONTACT = (4.36e4, 13.7, 0.146)
"""Stiffness [1/s^2], damping [1/s] and impedance at the surface [-] of MuJoCo's contact as `--no-fit` takes
them: the fit's result with MuJoCo 4.0."""

HARDEST = 0.9
DEEP = 0.5
"""Impedance of the contact at a depth [-], and that depth [m]: it grows in proportion, so that the force does
not jump at a touch-down, as that of Eq. 14 does not."""

GRIP = 100.0
"""Impedance of friction over that of the normal force [-]."""

SERVO = Motor(speed_gain=5e3, torque_limit=1e5, rotor_inertia=0.01)
"""Servo of the crank: a prescribed crank follows its command within torque over gain, here 0.06 rad/s."""

FEET = ("toe", "heel")

FILMED = 200  # control steps of the film


@dataclass
class Foot:
    """A foot in an episode.

    Attributes:
        geom: number of its ball.
        x: place along the ground [m].
        normal, slide: normal force [N] and speed along the ground [m/s].
        approach: speed at the last touch-down [m/s], 0 outside the ground.
        height: clearance of the ball [m].
    """

    geom: int
    x: float = 0.0
    normal: float = 0.0
    friction: float = 0.0
    slide: float = 0.0
    approach: float = 0.0
    height: float = 0.0


@dataclass
class Sums:
    """Sums of a control step, see `dynamics.layout.StrideSums`."""

    running_peak: float = 0.0
    loading: float = 0.0
    impulse: float = 0.0
    work: float = 0.0
    slip: float = 0.0


class MujocoEpisode:
    """Episode of HorseLeg-v0 in MuJoCo, from the start that the environment draws.

    Args:
        env: environment, after a reset.
        contact: numbers of the contact, see `CONTACT`.
    """

    def __init__(self, env: Any, contact: Sequence[float]) -> None:
        batch = env.unwrapped.batch
        engine = batch.engine
        self.batch = batch
        self.trunk = engine.trunk
        geometry = engine.limbs[0].geometry
        self.geometry = geometry
        state = {name: float(value.ravel()[0]) for name, value in engine.state.items()}
        report = {name: float(value.ravel()[0]) for name, value in engine.report.items()}
        self.gait = np.array([state[name] for name in PARAMETERS])
        self.gait_rate = np.zeros(4)
        self.filters = engine.filters.to_array()
        self.reach = batch.body.reach(engine, batch.dt)
        self.lead = float(batch.task_record["lead"].item())
        theta = state["crank_angle"]
        text = geometry.to_mjcf(
            theta=theta, swing=report["swing_angle"], trunk=self.trunk, motor=SERVO, ground=engine.ground
        )
        self.model = mujoco.MjModel.from_xml_string(text)
        # A soft contact would creep along the ground: friction is stiffer than the normal force
        self.model.opt.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        self.model.opt.impratio = GRIP
        self.data = mujoco.MjData(self.model)
        self.h = float(self.model.opt.timestep)
        names = {self.model.joint(k).name: k for k in range(self.model.njnt)}
        self.x, self.z, self.crank, self.swing = (names[name] for name in ("x", "z", CRANK_LINK, "swing"))
        self.feet = [Foot(self.model.geom(name).id) for name in FEET]
        for geom in (self.model.geom("floor").id, *(foot.geom for foot in self.feet)):
            # Negative numbers are stiffness and damping themselves; the impedance grows with depth
            self.model.geom_solref[geom] = -contact[0], -contact[1]
            self.model.geom_solimp[geom] = contact[2], HARDEST, DEEP, 0.5, 1.0
        self.data.qpos[[self.x, self.z]] = report["x"], report["y"]
        self._set_speeds(geometry, names, theta, state, report)
        self.weight = GRAVITY * (self.trunk.mass + geometry.mass)
        self.stance = StanceCounter(LIFT_OFF * self.weight)
        self.allowance = BEARING * LONGEST_STRIDE
        self.time = 0.0
        self.peaks = 0.0
        mujoco.mj_forward(self.model, self.data)
        for foot in self.feet:
            foot.x, _, foot.height = self.data.geom_xpos[foot.geom]

    def _set_speeds(
        self, geometry: Any, names: dict[str, int], theta: float, state: dict[str, float], report: Any
    ) -> None:
        """Set the speeds of all joints to those of the start."""
        rate = state["crank_angle_rate"]
        spin = report["swing_angle_rate"]
        frame = FrameMotion(phi=report["swing_angle"], phi_rate=spin)
        at = pose(geometry, theta, theta_rate=rate, frame=frame)
        tree = link_tree(geometry.mechanism)
        travel = geometry.travel
        absolute: dict[str, float] = {}
        for link, carrier, _ in tree.tree:
            absolute[link] = at.angular_velocities[tree.links[link][0]]
            parent = absolute.get(carrier, travel * spin)
            self.data.qvel[names[link]] = rate if link == CRANK_LINK else absolute[link] - parent
        self.data.qvel[self.swing] = spin
        self.data.qvel[[self.x, self.z]] = report["vx"], report["vy"]

    @property
    def theta(self) -> float:
        """Crank angle [rad]."""
        return float(self.data.qpos[self.crank])

    @property
    def theta_rate(self) -> float:
        """Speed of the crank [rad/s]."""
        return float(self.data.qvel[self.crank])

    def observe(self) -> NDArray[np.float32]:
        """Return the observation, in the order and with the scales of the manual page."""
        c = np.cos(self.theta)
        s = np.sin(self.theta)
        speeds = np.tanh([self.data.qvel[self.x] / 5.0, self.data.qvel[self.z] / 2.0])
        height = np.tanh((self.data.qpos[self.z] - self.trunk.height) / 0.3)
        loads = np.array([foot.normal for foot in self.feet])
        contacts = [float(foot.height < 0.0) for foot in self.feet]
        approach = np.tanh([foot.approach / 2.0 for foot in self.feet])
        weight = self.weight
        values = [
            *(s, c),
            *((self.gait - MIDDLE) / HALF_RANGE),
            *(self.gait_rate / self.filters[:, 1]),
            *(*speeds, height, self.allowance),
            *contacts,
            *np.tanh(loads / (3.0 * weight)),
            *approach,
            np.tanh(self.stance.running / (3.0 * weight)),
            np.tanh(self.stance.steepest / (30.0 * weight)),
        ]
        observation: NDArray[np.float32] = np.clip(np.array(values, np.float32), -1.0, 1.0)
        return observation

    def step(self, action: Any) -> tuple[float, bool]:
        """Play a control step; return its reward and whether the episode has failed."""
        body = self.batch.body
        heading = self.gait + self.lead * self.gait_rate
        command = np.clip(heading + self.reach * np.clip(action, -1.0, 1.0), body.low, body.high)
        sums = Sums()
        before = float(self.data.qpos[self.x])
        for _ in range(round(self.batch.dt / self.h)):
            self._substep(command, sums)
        self.time += self.batch.dt
        progress = float(self.data.qpos[self.x]) - before
        height = float(self.data.qpos[self.z])
        record = self.batch.task_record
        failed = not record["lowest"].item() < height < record["highest"].item()
        return self._reward(progress, sums, failed), failed

    def _substep(self, command: Floats, sums: Sums) -> None:
        """Advance by one step of MuJoCo and add what happened to the sums."""
        gain, most, fastest = self.filters.T
        wanted = np.clip(gain * (command - self.gait), -most, most)
        acceleration = np.clip(INNER * gain * (wanted - self.gait_rate), -fastest, fastest)
        self.gait = self.gait + self.h * self.gait_rate + 0.5 * self.h**2 * acceleration
        self.gait_rate = self.gait_rate + self.h * acceleration
        s = np.sin(self.theta)
        c = np.cos(self.theta)
        angle = self.gait[1] + self.gait[2] * s + self.gait[3] * c
        rate = self.gait_rate[1] + self.gait_rate[2] * s + self.gait_rate[3] * c
        rate += self.theta_rate * (self.gait[2] * c - self.gait[3] * s)
        # The exported servo damps the swing itself: ahead by as much, it follows a swing that moves
        self.data.actuator("swing").ctrl = angle + SWING_DAMPING / SWING_STIFFNESS * rate
        self.data.actuator(CRANK_LINK).ctrl = self.gait[0]
        mujoco.mj_step(self.model, self.data)
        self._read_feet()
        self._count(sums)

    def _read_feet(self) -> None:
        """Read forces and speeds of the feet."""
        for foot in self.feet:
            x, _, z = self.data.geom_xpos[foot.geom]
            speed = (foot.height - z) / self.h
            foot.slide = (x - foot.x) / self.h
            if z >= 0.0:
                foot.approach = 0.0
            elif foot.height >= 0.0:
                foot.approach = max(speed, self.batch.engine.ground.approach_floor)
            foot.x, foot.height = float(x), float(z)
            foot.normal = foot.friction = 0.0
        force = np.zeros(6)
        for k in range(self.data.ncon):
            contact = self.data.contact[k]
            mujoco.mj_contactForce(self.model, self.data, k, force)
            for foot in self.feet:
                if foot.geom in (contact.geom1, contact.geom2):
                    foot.normal += force[0]
                    foot.friction += float(np.hypot(force[1], force[2]))

    def _count(self, sums: Sums) -> None:
        """Add a substep to the sums, as `dynamics.observables.count_stride` does."""
        h = self.h
        load = sum(foot.normal for foot in self.feet)
        push = float(np.hypot(load, sum(foot.friction for foot in self.feet)))
        peak, running, loading = self.stance.add(self.theta, load, push, h)
        self.peaks += peak
        sums.running_peak += running
        sums.loading += loading
        sums.impulse += h * load
        torques = {
            self.crank: float(self.data.actuator(CRANK_LINK).force[0]),
            self.swing: float(self.data.actuator("swing").force[0]),
        }
        sums.work += h * sum(max(torque * self.data.qvel[at], 0.0) for at, torque in torques.items())
        if self.stance.is_open:
            rubbed = sum(foot.normal * abs(foot.slide) for foot in self.feet)
            sums.slip += h * rubbed / max(load, 1e-9)

    def _reward(self, progress: float, sums: Sums, failed: bool) -> float:
        """Return the sum of all terms of `hoof_env.tasks.reward`."""
        w = self.batch.weights
        dt = self.batch.dt
        asked = float(self.batch.target_speed[0]) * dt
        allowance = min(self.allowance + BEARING * dt, BEARING * LONGEST_STRIDE)
        impulse = sums.impulse / self.weight
        borne = min(impulse, allowance)
        self.allowance = allowance - borne
        borne -= impulse - borne
        pace = min(float(np.clip(progress / asked, -1.0, 1.0)), self.theta_rate / STEPPING)
        return (
            w["progress"] * min(progress, asked)
            - w["overspeed"] * max(progress - asked, 0.0)
            - 1e-3 * w["peak"] * sums.running_peak
            - 1e-6 * w["loading"] * sums.loading
            - 1e-3 * w["energy"] * sums.work
            - w["slip"] * sums.slip
            + w["support"] * min(pace * borne, abs(pace) * borne)
            - (w["failure"] * (self.batch.episode_seconds - self.time) if failed else 0.0)
        )

    def pose_at(self, theta: float) -> Floats:
        """Return the bars with the crank at `theta` [rad], all links in place, and the trunk's coordinates as
        they are."""
        frame = FrameMotion(phi=float(self.data.qpos[self.swing]))
        at = pose(self.geometry, theta, frame=frame)
        tree = link_tree(self.geometry.mechanism)
        hip = np.array([self.data.qpos[self.x], self.data.qpos[self.z]])
        joints = [body for bodies in tree.links.values() for body in bodies]
        ends = [
            (self.geometry.mechanism.bodies[k].tail, self.geometry.mechanism.bodies[k].head) for k in joints
        ]
        return np.array([[hip + at.point(one), hip + at.point(other)] for one, other in ends])

    def bars(self) -> Floats:
        """Return the ends of all bars and the places of the feet in the plane, shape (n, 2, 2)."""
        lines = []
        for k in range(self.model.ngeom):
            if self.model.geom_type[k] == mujoco.mjtGeom.mjGEOM_CAPSULE:
                axis = self.data.geom_xmat[k].reshape(3, 3)[[0, 2], 2] * self.model.geom_size[k, 1]
                middle = self.data.geom_xpos[k][[0, 2]]
                lines.append([middle - axis, middle + axis])
        return np.array(lines)


# Playing


@dataclass(frozen=True)
class Figures:
    """Figures of an episode: mean speed [m/s], mean stance peak [N], return, and whether it failed."""

    speed: float
    peak: float
    value: float
    failed: float


def play_there(
    env: Any, policy: Any, seed: int, contact: Sequence[float], frames: list[Floats] | None = None
) -> Figures:
    """Play an episode in MuJoCo.

    Args:
        env: environment whose start and settings are taken.
        policy: policy for its observations.
        seed: seed of the start.
        contact: see `MujocoEpisode`.
        frames: list that gets the bars of each control step; None for none.
    """
    env.reset(seed=seed, options=start_of(policy))
    there = MujocoEpisode(env, contact)
    begin = float(there.data.qpos[there.x])
    value = 0.0
    failed = False
    steps = round(there.batch.episode_seconds / there.batch.dt)
    for k in range(steps):
        observation = there.observe()
        action, _ = policy.predict(observation, episode_start=np.array([k == 0]), deterministic=True)
        reward, failed = there.step(np.asarray(action, float))
        value += reward
        if frames is not None:
            frames.append(there.bars())
        if failed:
            break
    peaks = there.peaks / max(there.stance.count, 1)
    return Figures((float(there.data.qpos[there.x]) - begin) / there.time, peaks, value, float(failed))


def play_here(env: Any, policy: Any, seed: int) -> Figures:
    """Play the episode of the same start in the environment itself."""
    (episode,) = play(env, policy, [seed])
    names = ("speed_m_s", "stance_peak_n", "return", "failed")
    return Figures(*(float(episode[name]) for name in names))


def mean(found: Sequence[Figures]) -> Figures:
    """Return the mean figures of episodes."""
    return Figures(*np.mean([[one.speed, one.peak, one.value, one.failed] for one in found], axis=0))


def misses(there: Figures, here: Figures) -> Floats:
    """Return the relative differences of speed, stance peak and return."""
    pairs = ((there.speed, here.speed), (there.peak, here.peak), (there.value, here.value))
    return np.array([one / other - 1 for one, other in pairs])


def told(contact: Sequence[float]) -> str:
    """Return the numbers of a contact in words."""
    return f"{contact[0]:.4g} 1/s^2, {contact[1]:.4g} 1/s, impedance {contact[2]:.4g} at the surface"


def fit(env: Any, policy: Any, seeds: Sequence[int], evaluations: int) -> tuple[float, float, float]:
    """Find the contact with which the policy's episodes in MuJoCo come nearest to the environment's: the
    smallest sum of squares of `misses`, by a simplex over the logarithms."""
    from scipy.optimize import minimize

    here = mean([play_here(env, policy, seed) for seed in seeds])

    def error(logs: Floats) -> float:
        contact = np.exp(logs).tolist()
        there = mean([play_there(env, policy, seed, contact) for seed in seeds])
        found = float(np.sum(misses(there, here) ** 2))
        print(f"{told(contact)}: error {found:.5f}", flush=True)
        return found

    options = {"maxfev": evaluations, "initial_simplex": np.log(CONTACT) + 0.3 * np.eye(4, 3, -1)}
    best = minimize(error, np.log(CONTACT), method="Nelder-Mead", options=options)
    stiffness, damping, impedance = np.exp(best.x).tolist()
    return stiffness, damping, impedance


def film(here: Sequence[Floats], there: Sequence[Floats], path: Path) -> None:
    """Write a film of both: the environment's leg above, MuJoCo's below."""
    from PIL import Image, ImageDraw

    width = 480
    height = 200
    scale = 85.0  # pixels per metre
    pictures = []
    for lines in zip(here, there, strict=False):
        picture = Image.new("RGB", (width, 2 * height), "white")
        pen = ImageDraw.Draw(picture)
        for row, (bars, title) in enumerate(zip(lines, ("hoof_env", "MuJoCo"), strict=True)):
            left = bars[:, :, 0].mean() - width / scale / 2
            ground = (row + 1) * height - 16
            pen.rectangle((0, ground, width, ground + 16), fill="#EFE6D8")
            for mark in range(int(left), int(left + width / scale) + 2):
                at = (mark - left) * scale
                pen.line((at, ground, at, ground + 6), fill="#666666")
            for (x1, y1), (x2, y2) in bars:
                ends = ((x1 - left) * scale, ground - y1 * scale, (x2 - left) * scale, ground - y2 * scale)
                pen.line(ends, fill="#0072B2" if row == 0 else "#D55E00", width=3)
            pen.text((6, row * height + 4), title, fill="black")
        pictures.append(picture.quantize(16))
    pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=40, loop=0, optimize=True)


def bars_here(env: Any, policy: Any, seed: int, like: MujocoEpisode) -> list[Floats]:
    """Play an episode in the environment; return the bars of each control step, in the links of `like`."""
    observation, _ = env.reset(seed=seed, options=start_of(policy))
    engine = env.unwrapped.batch.engine
    frames: list[Floats] = []
    done = False
    while not done:
        action, _ = policy.predict(observation, episode_start=np.array([not frames]), deterministic=True)
        observation, _, terminated, truncated, _ = env.step(action)
        done = terminated or truncated
        for name, joint in (("x", like.x), ("y", like.z), ("swing_angle", like.swing)):
            like.data.qpos[joint] = engine.report[name].item()
        frames.append(like.pose_at(engine.state["crank_angle"].item()))
    return frames


@dataclass(frozen=True)
class Args:
    """Arguments of the command."""

    policy: str = POLICY
    """path of the agent"""
    episodes: int = 20
    """of the run and of the agent, there and here"""
    fit: bool = True
    """fit the contact to the run first; otherwise take the one found before"""
    evaluations: int = 60
    """contacts that the fit tries"""
    film: bool = False
    """write transfer.gif, too"""
    out: Path = Path("runs/transfer")
    """folder of table.md and transfer.gif"""


def main(argv: list[str] | None = None) -> None:
    """Fit, play, print."""
    import tyro

    args = tyro.cli(Args, args=argv, prog="python -m benchmarks.mujoco_transfer", description=__doc__)
    count("--episodes", args.episodes, most=len(SEEDS))
    check_folder(args.out)
    args.out.mkdir(parents=True, exist_ok=True)
    env = runs.make_env(ENV_ID)
    policies = {name: find_policy(name, env, ENV_ID) for name in ("run", args.policy)}
    contact = fit(env, policies["run"], FIT_SEEDS, args.evaluations) if args.fit else CONTACT
    rows = []
    head = ["gait", "", "speed [m/s]", "stance peak [N]", "return", "fell"]
    for name, policy in policies.items():
        here = mean([play_here(env, policy, seed) for seed in SEEDS[: args.episodes]])
        there = mean([play_there(env, policy, seed, contact) for seed in SEEDS[: args.episodes]])
        for where, figures in (("hoof_env", here), ("MuJoCo", there)):
            numbers = (figures.speed, figures.peak, figures.value, figures.failed)
            rows.append([Path(name).name, where, *(f"{number:.3g}" for number in numbers)])
        rows.append([Path(name).name, "difference", *(f"{100 * x:+.0f} %" for x in misses(there, here)), ""])
    text = f"Contact: {told(contact)}.\n\n{markdown_table(head, rows)}\n"
    runs.write_text(args.out / "table.md", text)
    print(text)
    if args.film:
        frames: list[Floats] = []
        play_there(env, policies[args.policy], SEEDS[0], contact, frames)
        env.reset(seed=SEEDS[0])
        shown = MujocoEpisode(env, contact)
        here_frames = bars_here(env, policies[args.policy], SEEDS[0], shown)
        film(here_frames[:FILMED:2], frames[:FILMED:2], args.out / "transfer.gif")
    env.close()


if __name__ == "__main__":
    run(main)
