"""Trainings that are stopped, killed or diverge: what is left is whole and goes on as if nothing had been."""

import json
import multiprocessing
import os
import random
import shutil
import signal
import time
import zipfile
from pathlib import Path

import filelock
import numpy as np
import pytest
from stable_baselines3.common.callbacks import BaseCallback

from agents.checkpoints import REPLAY, STATE, checkpoints, whole
from agents.runs import CHECKPOINTS, SavedModel, alone
from agents.train import Args, main, train
from agents.watch import DivergedError
from hoof_env.errors import DataFileError, OutputError, ParameterError
from hoof_env.policies.saved import ABOUT, WEIGHTS
from tests.agents.conftest import ENV_ID, SHORT, TINY, change, train_tiny, training_episodes

KILLS = 2
ALWAYS = 1e-9  # seconds between two checkpoints: one between all rollouts
TINY_OFF = (
    "learning_starts=40", "batch_size=16", "gradient_steps=1", "train_freq=2", "gamma=0.9",
    '{"policy_kwargs": {"net_arch": [8]}, "normalize": {"norm_obs": true}}',
)  # fmt: skip
NOISE = ("noise_type=ornstein-uhlenbeck", "noise_std=0.3")
COST = '{"cost": {"indicator": 400.0}}'
CASES = {
    "ppo": {"params": (*TINY, "learning_rate=lin_0.01")},
    "ppo_flat": {"params": (*TINY, "learning_rate=lin_0.01", "norm_reward=true")},
    "ppo_lagrangian": {"params": (*TINY, "cost_limit=1.0"), "env_kwargs": (*SHORT, COST)},
    "sac": {"params": TINY_OFF, "steps": 160},
    "td3": {"params": (*TINY_OFF, *NOISE), "steps": 160},
    "tqc": {"params": (*TINY_OFF, "learning_starts=100"), "steps": 160},
}


class At(BaseCallback):
    """Do something to the model at a step."""

    def __init__(self, step, action):
        super().__init__()
        self.step, self.action = step, action

    def _on_step(self):
        if self.num_timesteps >= self.step:
            self.action(self.model)
            self.step = float("inf")
        return True


def interrupt(model):
    os.kill(os.getpid(), signal.SIGINT)


def arguments(algo: str, out: Path, **changes) -> Args:
    common = {"n_envs": 4, "env_kwargs": SHORT, "steps": 512, "checkpoint_every": 1000.0, "out": out}
    return Args(algo=algo, **{**common, **CASES[algo], **changes})


@pytest.mark.parametrize("algo", CASES)
def test_a_stopped_run_goes_on_as_if_it_had_not_been(algo, tmp_path):
    whole = train(arguments(algo, tmp_path / "whole"))
    stopped = train(arguments(algo, tmp_path / "stopped"), At(90, interrupt))
    assert stopped.stopped_by == signal.SIGINT
    assert stopped.steps < whole.steps
    assert SavedModel.find(stopped.folder).path == stopped.folder / "model.zip"
    resumed = train(arguments(algo, tmp_path / "stopped", resume=True))
    assert resumed.steps == whole.steps
    assert (resumed.folder / WEIGHTS).read_bytes() == (whole.folder / WEIGHTS).read_bytes()
    assert (resumed.folder / ABOUT).read_bytes() == (whole.folder / ABOUT).read_bytes()  # statistics
    assert training_episodes(resumed.folder) == training_episodes(whole.folder)
    assert json.loads((resumed.folder / "run.json").read_text())["resumed"] == [stopped.steps]
    assert not (resumed.folder / CHECKPOINTS).exists()


def test_one_process_trains_in_a_folder(tmp_path):
    def start_another(model):
        with pytest.raises(OutputError, match="another process is at work there"):
            train(arguments("ppo", tmp_path / "run", resume=True))

    train(arguments("ppo", tmp_path / "run"), At(90, start_another))


def test_a_file_system_without_locks_is_reported(tmp_path, monkeypatch):
    def acquire(self, **_):
        raise NotImplementedError

    monkeypatch.setattr(filelock.FileLock, "acquire", acquire)
    with pytest.warns(UserWarning, match="has no locks"), alone(tmp_path / "run"):
        assert (tmp_path / "run").is_dir()


def test_killed_again_and_again(tmp_path):
    """SIGKILL at random moments: the command with --resume ends as one that was never killed."""
    steps = 128 * 32  # so many rollouts, of which the two that are killed take a few
    argv = [
        "--steps", str(steps), "--n-envs", "4", "--checkpoint-every", "0.02", "--resume",
        "--env-kwargs", *SHORT, "--params", *TINY,
    ]  # fmt: skip
    folder, moments, kills = tmp_path / "killed", random.Random(), 0
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["agents.train", "hoof_env.envs.sb3", "torch.utils.tensorboard"])
    for attempt in range(KILLS + 1):
        before = checkpoints(folder)[:1]
        process = context.Process(target=main, args=([*argv, "--out", str(folder)],))
        process.start()
        deadline = time.monotonic() + 60
        while attempt < KILLS and checkpoints(folder)[:1] == before and process.is_alive():
            assert time.monotonic() < deadline, "no checkpoint within a minute"
            time.sleep(0.01)
        if attempt < KILLS:
            time.sleep(moments.uniform(0, 0.1))
            process.kill()
        process.join(120)
        kills += process.exitcode == -signal.SIGKILL
        for checkpoint in checkpoints(folder):
            assert {STATE, "model.zip", WEIGHTS, ABOUT} <= {path.name for path in checkpoint.iterdir()}
            assert zipfile.ZipFile(checkpoint / "model.zip").testzip() is None
    assert kills == KILLS
    assert process.exitcode == 0
    record = json.loads((folder / "run.json").read_text())
    assert record["finished"]["steps"] == steps
    assert len(record["resumed"]) == KILLS
    whole = train_tiny(tmp_path / "whole", steps=steps, checkpoint_every=0)
    assert (folder / WEIGHTS).read_bytes() == (whole.folder / WEIGHTS).read_bytes()
    assert training_episodes(folder) == training_episodes(whole.folder)
    assert not list(folder.rglob(".unfinished-*"))


def test_a_finished_run_is_not_run_again(trained):
    again = train_tiny(trained.folder, resume=True)
    assert (again.steps, again.stopped_by) == (256, None)
    assert again.seconds == pytest.approx(trained.seconds, abs=1e-3)


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "stopped"
    return train(arguments("sac", out, checkpoint_every=ALWAYS), At(90, interrupt)).folder


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"seed": 1}, "seed: 0 there, 1 here"),
        ({"steps": 200}, "n_timesteps: 160 there, 200 here"),
        ({"params": (*TINY_OFF, "gamma=0.5")}, "gamma: 0.9 there, 0.5 here"),
        ({"env_kwargs": (*SHORT, "trunk=rail")}, "trunk"),
        ({"env_id": "hoof_env/HorseLegRail-v0"}, "HorseLegRail"),
        ({"out": None}, "--out"),
        ({"resume": False}, "--resume"),
    ],
    ids=str,
)
def test_another_command_does_not_resume(stopped, changes, said):
    with pytest.raises((ParameterError, DataFileError, OutputError), match=said):
        train(arguments("sac", **{"out": stopped, "resume": True, **changes}))


def test_a_run_that_saw_on_another_scale_does_not_resume(stopped, tmp_path):
    out = shutil.copytree(stopped, tmp_path / "run")
    change(out / "run.json", observation_scales={"height": "tanh(x / 9)"})
    with pytest.raises(ParameterError, match=r"observation_scales, height: 'tanh\(x / 9\)', expected"):
        train(arguments("sac", out, resume=True))


def test_other_versions_and_threads_are_reported_on_a_resume(tmp_path):
    train(arguments("ppo", tmp_path), At(90, interrupt))
    record = json.loads((tmp_path / "run.json").read_text())
    record["versions"] |= {"torch": "0.1", "commit": "another"}
    record["args"]["torch_threads"] = 64
    (tmp_path / "run.json").write_text(json.dumps(record))
    said = r"other bits: torch 0\.1 there, [^;]* here; torch_threads 64 there, 1 here$"
    with pytest.warns(UserWarning, match=said) as told:
        train(arguments("ppo", tmp_path, resume=True))
    assert len([one for one in told if "--resume" in str(one.message)]) == 1


def test_a_full_disk_is_reported_and_the_last_checkpoint_stays(tmp_path):
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("no device that is always full")

    def fill(model):
        model.env.venv.results_writer.file_handler = file = full.open("w")
        file.write("what does not fit")

    params = (*TINY, "normalize=true")
    with pytest.raises(OutputError, match=rf"^cannot write to '{tmp_path}/run': No space left on device$"):
        train(arguments("ppo", tmp_path / "run", params=params, checkpoint_every=ALWAYS), At(260, fill))
    assert [one.name for one in checkpoints(tmp_path / "run")] == ["256", "128"]
    assert train(arguments("ppo", tmp_path / "run", params=params, resume=True)).steps == 512


def test_a_model_without_checkpoints_is_not_written_over(tmp_path):
    train(arguments("ppo", tmp_path, checkpoint_every=0), At(90, interrupt))
    before = (tmp_path / WEIGHTS).read_bytes()
    with pytest.raises(OutputError, match="no checkpoint"):
        train(arguments("ppo", tmp_path, checkpoint_every=0, resume=True))
    assert (tmp_path / WEIGHTS).read_bytes() == before


def test_a_damaged_checkpoint_is_named_and_an_earlier_one_serves(stopped, tmp_path):
    folder = tmp_path / "run"
    shutil.copytree(stopped, folder)
    last, earlier = checkpoints(folder)
    for file in last.iterdir():
        whole = file.read_bytes()
        # One flipped bit in a header, in numbers and at the end, with which a pickle may well be readable.
        for place in (9, len(whole) // 2, len(whole) - 2):
            content = bytearray(whole)
            content[place] ^= 1
            file.write_bytes(content)
            with pytest.raises(DataFileError, match=rf"checkpoints/{last.name}: "):
                train(arguments("sac", folder, resume=True))
        file.write_bytes(whole)
    (last / REPLAY).unlink()
    with pytest.raises(DataFileError, match=rf"checkpoints/{last.name}: .*{REPLAY}"):
        train(arguments("sac", folder, resume=True))
    shutil.rmtree(last)
    assert train(arguments("sac", folder, resume=True)).steps == 160
    assert json.loads((folder / "run.json").read_text())["resumed"][-1] == int(earlier.name)


def test_environments_without_a_state_start_new_episodes(tmp_path):
    pendulum = {"env_id": "Pendulum-v1", "n_envs": 2, "steps": 1024, "params": TINY}
    stopped = train(Args(out=tmp_path / "run", **pendulum), At(700, interrupt))
    assert stopped.steps == 704
    assert train(Args(out=tmp_path / "run", resume=True, **pendulum)).steps == 1024
    assert {length for _, length in training_episodes(tmp_path / "run")} == {"200"}


@pytest.mark.parametrize(
    ("algo", "rate"),
    [(algo, rate) for algo in ("ppo", "sac", "tqc") for rate in ("1e3", "1e6", "1e30", "1e38")]
    + [("td3", "1e30"), ("td3", "1e38")],
)
def test_divergence_stops_the_training(algo, rate, tmp_path):
    params = (*CASES[algo]["params"], f"learning_rate={rate}")
    with pytest.raises(DivergedError, match=r"diverged before step .* learning rate"):
        train(arguments(algo, tmp_path / "run", params=params))
    assert not (tmp_path / "run" / "model.zip").exists()


@pytest.mark.parametrize(("algo", "network"), [("ppo", "value_net"), ("sac", "critic_target")])
def test_the_last_good_checkpoint_survives(algo, network, env, tmp_path):
    """A value that is not finite in a network that does not act, which nothing else would notice."""

    def spoil(model):
        next(getattr(model.policy, network).parameters()).data[0] = np.nan

    with pytest.raises(DivergedError, match=r"last good checkpoint is .*checkpoints/128"):
        train(arguments(algo, tmp_path / "run", checkpoint_every=ALWAYS), At(132, spoil))
    saved = SavedModel.find(tmp_path / "run")
    policy = saved.load(env, ENV_ID)
    assert saved.path.parent.name == "128"
    assert all(bool(one.isfinite().all()) for one in policy.model.policy.parameters())


def test_a_checkpoint_is_whole_or_not_there(tmp_path):
    def write(name, *raised):
        with whole(tmp_path / "checkpoints" / name) as stage:
            (stage / "file").write_text("half")
            assert name not in {path.name for path in checkpoints(tmp_path)}
            for error in raised:
                raise error

    write("5")
    with pytest.raises(KeyboardInterrupt):
        write("7", KeyboardInterrupt)
    assert [path.name for path in (tmp_path / "checkpoints").iterdir()] == ["5"]
    assert [path.name for path in checkpoints(tmp_path)[0].iterdir()] == ["file"]


def test_curves_show_each_step_once(tmp_path):
    """Of a process that died after its last checkpoint, what is played again is not shown."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    def die(model):
        raise ZeroDivisionError

    out = tmp_path / "run"
    with pytest.raises(ZeroDivisionError):
        train(arguments("ppo", out, checkpoint_every=ALWAYS), At(450, die))
    for checkpoint in checkpoints(out)[:1]:
        shutil.rmtree(checkpoint)  # it died long after one
    train(arguments("ppo", out, resume=True))
    curves = EventAccumulator(str(out / "tensorboard"))
    curves.Reload()
    assert [point.step for point in curves.Scalars("rollout/ep_rew_mean")] == [128, 256, 384, 512]
