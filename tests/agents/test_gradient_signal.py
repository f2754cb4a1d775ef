"""Signal of the first policy gradient: large where actions pay at once, none where they change nothing."""

from dataclasses import replace

import numpy as np
import pytest

from agents.gradient_signal import Recording, first_step, record, signal_to_noise
from hoof_env.errors import ParameterError

STEPS, ROWS = 400, 64


def made_up(pay):
    """Return a recording of random observations whose reward is a function of observation and noise."""
    random = np.random.default_rng(0)
    seen = random.standard_normal((STEPS + 1, ROWS, 3)).astype(np.float32)
    noise = random.standard_normal((STEPS, ROWS, 2)).astype(np.float32)
    ended = np.zeros((STEPS, ROWS), bool)
    ended[99::100] = True
    terms = {"pay": pay(seen[:-1], noise), "luck": random.standard_normal((STEPS, ROWS))}
    return Recording(seen, noise, terms, ended, np.zeros_like(ended))


def test_a_reward_of_feedback_is_signal_and_luck_is_not():
    recording = made_up(lambda seen, noise: seen[..., 0].astype(float) * noise[..., 1])
    clear = signal_to_noise(recording, {"pay": 1.0})
    assert clear > 10.0
    assert abs(signal_to_noise(recording, {"luck": 1.0})) < 0.2
    # Luck of ten times the size hides it, and the size of the whole reward changes nothing
    assert 0.2 < signal_to_noise(recording, {"pay": 1.0, "luck": 10.0}) < clear / 10
    assert signal_to_noise(recording, {"pay": 7.0}) == pytest.approx(clear)


def test_the_noise_is_that_of_a_rollout():
    """Half the steps have half the signal over their own noise, but a rollout is as long as before."""
    recording = made_up(lambda seen, noise: seen[..., 0].astype(float) * noise[..., 1])
    half = STEPS // 2
    short = replace(
        recording,
        observations=recording.observations[: half + 1],
        noise=recording.noise[:half],
        terms={name: values[:half] for name, values in recording.terms.items()},
        ended=recording.ended[:half],
        failed=recording.failed[:half],
    )
    weights = {"pay": 1.0}
    assert signal_to_noise(short, weights) == pytest.approx(signal_to_noise(recording, weights), rel=0.1)


def test_terms_are_recorded_with_a_weight_of_1_also_at_the_end():
    first, second = (
        record("hoof_env/HorseRough-v0", 2, 30, episode_seconds=1.0, reward_weights={"fall": fall})
        for fall in (1.0, 50.0)
    )
    assert first.ended[24].all()
    for name, values in first.terms.items():
        assert np.array_equal(values, second.terms[name])
    assert np.allclose(first.terms["alive"], 0.04)
    assert np.array_equal(first.terms["fall"], -first.failed.astype(float))


def test_unknown_terms_and_no_weights_are_refused():
    recording = made_up(lambda seen, noise: noise[..., 0].astype(float))
    with pytest.raises(ParameterError, match="pay, luck, got 'slop'"):
        signal_to_noise(recording, {"slop": 1.0})
    with pytest.raises(ParameterError, match="not 0"):
        signal_to_noise(recording, {"pay": 0.0})


def test_a_step_goes_where_actions_pay_and_whitening_undoes_the_scale_of_an_observation():
    """Feedback pays as much for a large observation as for one that a scale has made small."""
    recording = made_up(
        lambda seen, noise: 20 * (seen[..., 0] * noise[..., 0] + seen[..., 2] * noise[..., 1])
    )
    small = replace(recording, observations=recording.observations * np.float32([1.0, 1.0, 0.2]))
    for whitened, ratio in ((False, 0.2**2), (True, 1.0)):
        step = first_step(small, {"pay": 1.0}, 0.3, whitened)
        # What the same deviation of the true quantities does to the actions
        of_large, of_small = step.gain[0, 0], 0.2 * step.gain[2, 1]
        assert of_small / of_large == pytest.approx(ratio, rel=0.25)
        assert of_large > 5 * np.abs(step.gain[1]).max()
        seen = small.observations[:-1].reshape(-1, 3)
        actions, _ = step.predict(seen)
        assert np.sqrt((actions**2).mean()) == pytest.approx(0.3, rel=0.05)
