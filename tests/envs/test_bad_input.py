"""Every mistake gets one clear error that names it; a reset makes the env usable."""

from dataclasses import fields, replace
from functools import cached_property

import gymnasium
import numpy as np
import pytest
from pair import Pair

import marl_airhockey as ah
from marl_airhockey.sim.contracts.driver import Driver
from marl_airhockey.sim.contracts.scenario import Scenario
from marl_airhockey.sim.contracts.units import UNITS
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.core.scene import Scene
from marl_airhockey.sim.core.seat import make_seat
from marl_airhockey.sim.core.table import TABLES, Table

CORNERS = TABLES["standard"].vertices
GOOD = {"paddle_0": np.zeros(2, np.float32)}


def full_of(value):
    """Return a player whose actions are a value."""
    return lambda observation: np.full((len(observation), 2), value)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (
            lambda: ah.parallel_env("jugle"),
            "unknown scenario 'jugle' (did you mean 'juggle'",
        ),
        (lambda: ah.parallel_env("juggle", backend="pymonk"), "there are: pymunk"),
        (
            lambda: ah.parallel_env("juggle", drivers={"paddle_0": "strker"}),
            "unknown driver 'strker' (did you mean 'striker'",
        ),
        (
            lambda: ah.parallel_env("juggle", drivers={"paddle_7": "still"}),
            "'paddle_7'",
        ),
        (
            lambda: ah.parallel_env("juggle", options={"lifft": 1}),
            "did you mean 'lift'",
        ),
        (
            lambda: ah.parallel_env("duel", drivers={"paddle_0": "striker:back=abc"}),
            "option 'back' of striker: expected a number, got 'abc'",
        ),
        (
            lambda: ah.parallel_env("duel", drivers=["striker"]),
            "is not a dict of drivers by agent",
        ),
        (
            lambda: ah.parallel_env("juggle", physics={"preset": ["wooden"]}),
            "unknown physics preset",
        ),
        (lambda: ah.evaluate("still", "juggle", episodes=0), "episodes: 0 must be"),
        (
            lambda: ah.parallel_env("juggle", drivers={"paddle_0": "still"}),
            "every seat of 'juggle' has a driver",
        ),
        (
            lambda: ah.make_sb3_vec("juggle", drivers={"paddle_0": "still"}),
            "every seat of 'juggle' has a driver",
        ),
        (
            lambda: ah.gym_env("juggle", drivers={"paddle_0": "still"}),
            "every seat of 'juggle' has a driver",
        ),
        (
            lambda: ah.parallel_env("duel", options={"reaction": 0.12}),
            'not a multiple of control_dt, 0.05 s; .*"reaction": 0.1} or 0.15',
        ),
        (
            lambda: ah.parallel_env("juggle", control_dt=0.5),
            "control_dt: 0.5 s must be in 0.001 .. 0.2; in longer",
        ),
        (lambda: ah.league("rally", ["still", "random"]), "airhockey crossplay rally"),
        (lambda: ah.parallel_env("juggle").reset(seed="abc"), "seed: 'abc'; expected"),
        (
            lambda: ah.gym_env("juggle").reset(seed="abc"),
            "seed: 'abc'; expected a whole number",
        ),
        (lambda: ah.league("duel", ["still", "random"], games=3), "an even number"),
        (
            lambda: ah.parallel_env("juggle", observ="velocity"),
            "did you mean 'observe'",
        ),
        (lambda: ah.parallel_env("juggle", observe="speed"), "unknown observe 'speed'"),
        (lambda: ah.parallel_env("juggle", profile="real"), "unknown profile 'real'"),
        (lambda: ah.parallel_env("juggle", seats="arcad"), "there are: arcade"),
        (lambda: ah.parallel_env("juggle", options={"table": "big"}), "unknown table"),
        (lambda: ah.parallel_env("juggle", render_mode="ansi"), "render_mode 'ansi'"),
        (
            lambda: ah.parallel_env("juggle", physics={"tlt": 1.0}),
            "did you mean 'tilt'",
        ),
        (lambda: ah.parallel_env("juggle", physics={"tilt": -90.0}), "'tilt'"),
        (lambda: ah.parallel_env("juggle", physics={"tilt": (5.0, 2.0)}), "'tilt'"),
        (lambda: ah.parallel_env("juggle", physics={"tilt": "steep"}), "'tilt'"),
        (lambda: ah.parallel_env("juggle", physics={"tilt": np.nan}), "'tilt'"),
        (lambda: ah.parallel_env("juggle", control_dt=0.0), "control_dt"),
        (lambda: ah.parallel_env("juggle", substeps=2.5), "substeps"),
        (lambda: ah.parallel_env("juggle", max_cycles=0), "max_cycles"),
        (lambda: ah.parallel_env("juggle", options={"seconds": -1.0}), "seconds"),
        (lambda: ah.parallel_env("reach", options={"radius": -0.1}), "radius"),
        (lambda: ah.parallel_env("reach", options={"radius": (0.1, 0.2)}), "a range"),
        (lambda: ah.parallel_env("reach", options={"radius": "wide"}), "radius"),
        (lambda: ah.parallel_env("juggle", options={"pucks": 0}), "pucks"),
        (lambda: ah.make_vec("juggle", 0), "num_worlds: 0 must be a whole number"),
        (lambda: ah.make_vec("juggle", "64"), "num_worlds: '64' must be a whole"),
        (lambda: ah.make_sb3_vec("juggle", 2.5), "num_worlds: 2.5 must be a whole"),
        (lambda: ah.make_world("juggle", True), "num_worlds: True must be a whole"),
        (lambda: ah.make_vec("juggle", num_envs=4), "; use 'num_worlds'"),
        (lambda: ah.make_sb3_vec("juggle", n_envs=4), "; use 'num_worlds'"),
        (lambda: ah.make_world("juggle", num_envs=4), "; use 'num_worlds'"),
        (lambda: ah.gym_env("juggle", max_steps=4), "; use 'max_cycles'"),
        (lambda: ah.gym_env("juggle", camera="top"), "; use 'viewpoint'"),
        (lambda: Table.rectangle(-1.0, 0.6), "vertices"),
        (lambda: Table(CORNERS, puck_radius=0.4), "puck_radius"),
        (
            lambda: Table(CORNERS, paddle_radius=-0.1),
            "paddle_radius",
        ),
        (lambda: Scene(TABLES["standard"], ()), "seats"),
        (
            lambda: Scene(
                TABLES["standard"],
                (make_seat("robot", TABLES["standard"], 0),),
                blocks=1,
                block_radius=0.9,
            ),
            "block_radius",
        ),
        (lambda: ah.load_policy("nowhere.zip"), "no such policy"),
        (
            lambda: ah.parallel_env("juggle", profile=None),
            "profile: None is not the name",
        ),
        (
            lambda: ah.make_vec("juggle", 2, control_dt="0.05"),
            "'0.05' is not a time in s",
        ),
        (
            lambda: ah.gym_env("juggle", control_dt=True),
            "control_dt: True is not a time",
        ),
        (
            lambda: ah.make_world("juggle", options=["lift"]),
            "options: .* is not a dict",
        ),
        (
            lambda: ah.make_sb3_vec("juggle", substeps="2"),
            "substeps: '2' is not a whole",
        ),
        (
            lambda: ah.make_vec("juggle", 2, backend=3),
            "backend: 3 is not the name of a",
        ),
        (lambda: ah.make_vec("juggle", 2, physics={"tilt": "3"}), "'tilt'.*got '3'"),
        (lambda: ah.make_vec("juggle", 2, physics={"tilt": True}), "'tilt'.*got True"),
        (
            lambda: ah.parallel_env("duel", seats="robot", options={"seats": "arcade"}),
            "seats: given twice, 'robot' and in options 'arcade'",
        ),
        (
            lambda: ah.gym_env("reach", goals="dict", options={"goals": "flat"}),
            "goals: given twice",
        ),
        (lambda: ah.parallel_env("juggle", options={"pucks": 50}), "from 1 to 8"),
        (
            lambda: ah.parallel_env("hit_goal").reset(options={"radius": 0.5}),
            "'radius' is a field of hit_goal; set it when",
        ),
        (
            lambda: ah.make_vec("juggle", 2).reset(options=[1]),
            "options: .1.; expected a dict",
        ),
        (
            lambda: ah.make_vec("juggle", 2).reset(options={"reset_masks": [True] * 2}),
            "unknown reset option 'reset_masks'",
        ),
        (lambda: ah.evaluate("striker"), "scenario: none is known"),
        (lambda: ah.evaluate("still", "touch", seed=[1, 2]), "seed: .1, 2. must be"),
        (lambda: ah.evaluate("still", "touch", episodes=3.7), "episodes: 3.7 must be"),
        (lambda: ah.evaluate(full_of(np.inf), "touch"), "cannot act .* such as .inf"),
        (lambda: ah.evaluate(full_of(1j), "touch"), "cannot act .* of complex128"),
        (lambda: ah.evaluate(full_of(True), "touch"), "cannot act .* of bool"),
        (lambda: ah.evaluate(full_of("a"), "touch"), "cannot act .* of <U1"),
    ],
)
def test_it_is_refused_when_built(build, words):
    with pytest.raises(ValueError, match=words.replace("(", r"\(")):
        build()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "the file is empty"),
        ("ranges = 3", "ranges: 3; expected a dict"),
        ("[ranges]\ntilt = [true, 3]", r"tilt: expected a number or \(low, high\)"),
        ("[ranges]\ntilt = [6, 3]", "tilt: .* must lie within"),
        ("[ranges]\ntlt = [3, 6]", "did you mean 'tilt'"),
        ('base = "nobody"', "unknown base 'nobody'"),
        ("tilt =", "profile .*p.toml: "),
    ],
)
def test_a_wrong_profile_file_is_named(text, words, tmp_path):
    (tmp_path / "p.toml").write_text(text)
    with pytest.raises(ValueError, match=words):
        ah.parallel_env("touch", profile=str(tmp_path / "p.toml"))


@pytest.mark.parametrize(
    ("text", "words"),
    [("", "contains no parameters"), ('tilt = "3"', "got '3'"), ("x =", "no TOML")],
)
def test_a_wrong_physics_file_is_named(text, words, tmp_path):
    (tmp_path / "g.toml").write_text(text)
    with pytest.raises(ValueError, match=words):
        ah.parallel_env("touch", physics=str(tmp_path / "g.toml"))


def test_a_mask_needs_episodes_that_have_begun():
    envs = ah.make_vec("touch", 2)
    with pytest.raises(RuntimeError, match=r"reset_mask: call reset\(\)"):
        envs.reset(options={"reset_mask": np.array([True, False])})


def numeric_options():
    """Return the scenario, the name and the unit of every numeric option."""
    return [
        pytest.param(game, f.name, UNITS[f.type], id=f"{game}-{f.name}")
        for game in ah.scenario_names()
        for f in fields(ah.make_scenario(game))
        if f.type in UNITS
    ]


@pytest.mark.parametrize(("game", "name", "unit"), numeric_options())
def test_every_numeric_option_has_bounds(game, name, unit):
    above = unit.most + 1
    for value in (unit.least - 1, above, np.nan, np.inf, "far", True, (0.1, 0.2)):
        with pytest.raises(ValueError, match=rf"{name}: .*(must be|expected|a range)"):
            ah.make_scenario(game, **{name: value})
    with pytest.raises(ValueError, match=f"from {unit.least:g} to {unit.most:g}"):
        ah.make_scenario(game, **{name: int(above)})


@pytest.mark.parametrize(
    ("name", "element"),
    [
        ("obstacles", [3.0, 0.0, 0.1]),
        ("obstacles", [0.0, -0.5, 0.1]),
        ("obstacles", [0.0, 0.5, 0.05, 0.3, 0.6]),
        ("obstacles", [0.0, 0.0, 40.0]),
        ("reward_regions", [1.2, 0.0, 0.1, 1.0]),
        ("drag_regions", [0.0, 0.9, 0.1, 1.0]),
    ],
)
def test_elements_that_are_not_on_the_table_are_refused(name, element):
    with pytest.raises(ValueError, match=f"{name}: element 0, .* not on the table"):
        ah.make_scenario("juggle", **{name: [element]})


@pytest.mark.parametrize("name", [n for n, p in PARAMETERS.items() if not p.arms])
def test_every_parameter_takes_a_value_and_a_range(name):
    parameter = PARAMETERS[name]
    value = min(max(parameter.default, parameter.low), parameter.high)
    env = ah.parallel_env("touch", physics={name: value})
    env.reset(seed=0)
    assert env.physics[name] == pytest.approx(value)
    high = min(value + 0.01 * (parameter.high - parameter.low), parameter.high)
    env = ah.parallel_env("touch", physics={name: (value, high)})
    env.reset(seed=0)
    assert value <= env.physics[name] <= high
    env.step(GOOD)


@pytest.mark.parametrize(
    ("actions", "words"),
    [
        ({}, "missing agents .*paddle_0"),
        ({**GOOD, "paddle_1": np.zeros(2)}, "extra .*paddle_1"),
        (np.zeros(2), r"expected a dict with an action for each of \['paddle_0'\]"),
        ([0.1, 0.2], "actions: expected a dict .* got list"),
        ({"paddle_0": np.zeros(3)}, "paddle_0.*shape"),
        ({"paddle_0": "fast"}, "paddle_0"),
        ({"paddle_0": np.array([True, False])}, "dtype bool"),
        ({"paddle_0": np.array([np.nan, 0.0])}, "finite"),
        ({"paddle_0": np.array([np.inf, 0.0])}, "finite"),
    ],
)
def test_a_bad_action_is_named_and_the_env_goes_on(actions, words):
    env = ah.parallel_env("juggle")
    env.reset(seed=0)
    with pytest.raises(ValueError, match=words):
        env.step(actions)
    env.reset(seed=0)
    for _ in range(3):
        seen, *_ = env.step(GOOD)
    fresh = ah.parallel_env("juggle")
    fresh.reset(seed=0)
    for _ in range(3):
        other, *_ = fresh.step(GOOD)
    np.testing.assert_array_equal(seen["paddle_0"], other["paddle_0"])


def test_stepping_before_a_reset_and_after_the_end():
    env = ah.parallel_env("reach", max_cycles=2)
    with pytest.raises(RuntimeError, match="no episode is running"):
        env.step(GOOD)
    env.reset(seed=0)
    env.step(GOOD)
    _, _, _, truncated, _ = env.step(GOOD)
    assert truncated["paddle_0"]
    with pytest.raises(RuntimeError, match="the episode has ended; call reset"):
        env.step(GOOD)
    env.reset()
    env.step(GOOD)
    with pytest.raises(RuntimeError, match="render_mode"):
        env.render()


def test_a_scene_that_a_backend_cannot_play_is_refused_with_the_reason(backend):
    class BlocksAndMouths(Pair):
        @cached_property
        def scene(self):
            return replace(super().scene, blocks=2)

    with pytest.raises(ValueError, match="slide into a goal;"):
        ah.parallel_env(BlocksAndMouths(), backend=backend)


def test_an_unknown_agent_is_named():
    env = ah.parallel_env("duel")
    for read in env.observation_space, env.action_space, env.observation_labels:
        with pytest.raises(KeyError, match="unknown agent 'paddle_9'; there are: pad"):
            read("paddle_9")


def test_a_world_wants_its_shape():
    world = ah.make_world("reach", 3)
    world.reset(0)
    with pytest.raises(ValueError, match=r"\(3, 1, 2\)"):
        world.step(np.zeros((3, 2)))


def test_a_corrupt_or_foreign_policy_says_what_was_expected(tmp_path):
    for name, words in (
        ("a.zip", "not a stable-baselines3 policy"),
        ("a.onnx", "not an ONNX model"),
        ("a.txt", "expected a run folder"),
    ):
        path = tmp_path / name
        path.write_text("nothing of the kind")
        with pytest.raises(ValueError, match=words):
            ah.load_policy(path)


def test_a_missing_extra_is_one_line(monkeypatch):
    import importlib.util

    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util,
        "find_spec",
        lambda name, *a: None if name == "stable_baselines3" else find(name, *a),
    )
    with pytest.raises(RuntimeError, match=r"pip install 'marl_airhockey\[train\]'"):
        ah.make_sb3_vec("juggle")


def test_a_closed_environment_is_closed(backend):
    env = ah.parallel_env("juggle", backend=backend)
    env.reset(seed=0)
    state, _ = env.get_state()
    env.close()
    env.close()
    for call in (
        env.reset,
        lambda: env.step({"paddle_0": np.zeros(2)}),
        lambda: env.set_state(state),
    ):
        with pytest.raises(RuntimeError, match="this environment is closed"):
            call()
    many = ah.make_vec("juggle", 2)
    many.reset(seed=0)
    many.close()
    with pytest.raises(RuntimeError, match="closed"):
        many.step(np.zeros((2, 2), np.float32))


def test_a_state_of_another_scene_is_refused():
    env, other = ah.parallel_env("juggle"), ah.parallel_env("duel")
    for made in (env, other):
        made.reset(seed=0)
    message = "of another scene, with 2 paddles, 1 pucks.*expected 1 paddles"
    with pytest.raises(ValueError, match=message):
        env.set_state(*other.get_state())


def test_seeds_are_one_number_or_one_for_each_world():
    world = ah.make_world("reach", 3)
    for seeds in ([5, 9, 2], np.array([5, 9, 2])):
        world.reset(seeds)
        assert world.seeds.tolist() == [5, 9, 2]
    world.reset(7)
    assert world.seeds.tolist() == [7, 8, 9]
    for seed in ("a", 1.5, True, [1, 2], np.zeros((3, 1), int), -1, 2**64, [0, 1, -1]):
        with pytest.raises(
            ValueError, match=r"expected a whole number from 0 to 2\^64"
        ):
            world.reset(seed)


def test_large_seeds_are_seeds_of_their_own():
    large = (0, 2**53, 2**53 + 1, 2**63 - 1, 2**63, 2**63 + 1, 2**64 - 1)
    world = ah.make_world("reach", 1)
    starts = {world.reset(seed).tobytes() for seed in large}
    assert len(starts) == len(large)
    many = ah.make_world("reach", 3)
    for seed in (2**63 - 2, 2**64 - 2, [2**63, 5, 2**64 - 1]):
        many.reset(seed)
        own = seed if isinstance(seed, list) else [(seed + i) % 2**64 for i in range(3)]
        assert many.seeds.tolist() == own
        for row, start in zip(own, many.observation(), strict=True):
            np.testing.assert_array_equal(world.reset(row)[0], start)


@pytest.mark.parametrize(
    ("function", "result", "words"),
    [
        ("reward_terms", {"goal": np.zeros(1)}, r"'goal' has shape \(1,\)"),
        ("reward_terms", {"goal": 1.0}, r"'goal' has shape \(\), expected a number"),
        ("reward_terms", {"goal": np.zeros((1, 7))}, r"\(1, 7\), expected"),
        ("terminated", np.zeros((1, 2), bool), r"terminated has shape \(1, 2\)"),
        ("success", np.zeros((1, 5), bool), r"success has shape \(1, 5\)"),
    ],
)
def test_a_wrong_shape_of_a_scenario_is_named(function, result, words):
    kind = type("Wrong", (Pair,), {function: lambda self, t: result})
    env = ah.parallel_env(kind())
    with pytest.raises(ValueError, match=words):
        env.reset(seed=0)


def test_what_an_author_forgot_is_named():
    with pytest.raises(ValueError, match=r"NoRules lacks .*reward_terms"):
        ah.parallel_env(type("NoRules", (Scenario,), {"scene": Pair.scene}))

    class Nan(Pair):
        def reward_terms(self, t):
            return {"goal": np.full((*t.after.time.shape, 2), np.nan)}

    drivers = {"paddle_1": "still"}
    with pytest.raises(ValueError, match=r"terms \['goal'\] are nan"):
        ah.evaluate("still", Nan(), episodes=2, drivers=drivers)
    with pytest.raises(ValueError, match=r"must return \(action, memory\)"):
        ah.evaluate(Alone(), Pair(), episodes=2, drivers=drivers)


class Alone(Driver):
    """Driver that forgets its memory."""

    def act(self, view, memory):
        return np.zeros((len(view.reach), 2))


def test_physics_is_there_from_the_first_reset_on():
    for env in (ah.parallel_env("touch"), ah.gym_env("touch")):
        with pytest.raises(RuntimeError, match="physics: call reset"):
            _ = env.physics
        env.reset(seed=0)
        assert env.physics["tilt"] == 5.5


def test_labels_are_found_where_readme_says():
    expected = ah.parallel_env("touch").observation_labels("paddle_0")
    made = gymnasium.make("marl_airhockey/Touch-v0")
    assert made.unwrapped.observation_labels == expected
    assert ah.make_world("touch").observation_labels == expected
    assert ah.make_vec("touch").observation_labels == expected
