"""The list of what there is to play, and refusals of commands before anything is played."""

import re

import gymnasium as gym
import pytest

from hoof_env import cli
from hoof_env.commands.policies import EXTRAS
from hoof_env.envs.policies import start_of
from hoof_env.errors import DataFileError
from hoof_env.policies.catalogue import SHOWN, shipped_returns
from hoof_env.policies.find import find_policy


def test_every_id_has_its_lines_with_the_returns_of_its_policies(capsys):
    assert cli.main(["list"]) == 0
    said = capsys.readouterr().out
    for env_id in (name for name in gym.registry if name.startswith("hoof_env/")):
        scored = shipped_returns(env_id.removeprefix("hoof_env/"))
        returns = {policy: scored[policy] for policy in SHOWN if policy in scored}
        line = said.partition(f"{env_id}: ")[2].splitlines()[1]
        assert f"shipped {returns['policy']:.3g}" in line
        assert line.count(", ") == len(returns)
    extras = "".join(line for line in said.splitlines() if line.startswith(("extras", "others")))
    assert all(extra in extras for extra in EXTRAS)


def test_one_id_has_the_names_of_its_policies(capsys):
    assert cli.main(["list", "--env-id", "hoof_env/HorseLegRail-v0"]) == 0
    head, _, policies = capsys.readouterr().out.splitlines()
    assert head.startswith("hoof_env/HorseLegRail-v0: ")
    assert {"run", "walk", "open-loop", "shipped"} <= set(
        policies.strip().removeprefix("policies: ").split(", ")
    )
    assert cli.main(["list", "--env-id", "hoof_env/Horse-v0"]) == 0
    names = capsys.readouterr().out.splitlines()[2].strip().removeprefix("policies: ").split(", ")
    assert {"reference", "zero", "open-loop", "shipped"} <= set(names)
    assert "constant" not in names


@pytest.mark.parametrize("env_id", [name for name in gym.registry if name.startswith("hoof_env/")])
def test_every_name_that_is_listed_can_be_played_and_no_stored_one_is_left_out(env_id, capsys):
    assert cli.main(["list", "--env-id", env_id]) == 0
    line = capsys.readouterr().out.splitlines()[-1]
    names = line.strip().removeprefix("policies: ").split(", ")
    env = gym.make(env_id)
    for name in names:
        observation, _ = env.reset(seed=0, options=start_of(policy := find_policy(name, env, env_id)))
        assert env.action_space.contains(policy.predict(observation, episode_start=True)[0])
    for name in {"open-loop", "constant", "shipped"} - set(names):
        with pytest.raises(DataFileError):
            find_policy(name, env, env_id)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["list", "--env-id", "Horse"], "env_id: expected one of hoof_env/HorseLeg-v0, .*, got 'Horse'"),
        (["evaluate"], "policy: expected a name or the path of a trained model, got none"),
        (["evaluate", "run", "--episodes", "0"], "episodes: expected a whole number, 1 or more, got 0"),
        (["evaluate", "run", "--episodes", "9999999"], r"episodes: expected at most 1e\+06, got 9999999"),
        (["evaluate", "run", "--seed", "-1"], "seed: expected a whole number, 0 or more, got -1"),
        (["evaluate", "run", "--env-id", ""], "--env-id: expected a value, got an empty string"),
        (["evaluate", ""], "argument: expected a value, got an empty string"),
        (["evaluate", "run", "--published", "--seed", "3"], "neither episodes nor seed with it"),
        (["evaluate", "run", "--out", "scores.txt"], r"ends in \.csv, \.json, got 'scores\.txt'"),
        (["evaluate", "gallop"], "expected a name .* got 'gallop'"),
    ],
)  # fmt: skip
def test_a_refusal_is_one_line(arguments, words, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("hoof_env.evaluation.scores.play", lambda *_: pytest.fail("was played"))
    assert cli.main(arguments) == 2
    said = capsys.readouterr().err
    assert re.search(words, said), said
    assert said.count("\n") == 1
    assert not [*tmp_path.iterdir()]


def test_a_file_that_another_command_wrote_meanwhile_stays(monkeypatch, tmp_path, capsys):
    """The table is printed all the same."""
    out = tmp_path / "scores.csv"

    def play(*_):
        out.write_text("theirs", encoding="utf-8")
        return [{"return": 1.0}]

    monkeypatch.setattr("hoof_env.evaluation.scores.play", play)
    assert cli.main(["evaluate", "run", "--episodes", "1", "--out", str(out)]) == 2
    said = capsys.readouterr()
    assert re.search(r"exists already: .* the new one is '.*kept-.*scores\.csv'\n", said.err)
    assert "run" in said.out
    assert out.read_text(encoding="utf-8") == "theirs"
    (kept,) = tmp_path.glob("kept-*/scores.csv")
    assert kept.read_text(encoding="utf-8").startswith("policy,seed,return\n")
