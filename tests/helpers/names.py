"""Names that tests are made for, beside those of the library's lists."""

import importlib

import marl_airhockey as ah

GOALS = ["hit_goal", "hit_goal_velocity", "reach", "reach_velocity"]


def seats(scenario):
    return len(ah.make_scenario(scenario).scene.seats)


def ideal_backends():
    modules = {n: f"marl_airhockey.backends.{n}" for n in ah.backend_names()}
    made = {n: importlib.import_module(m).make for n, m in modules.items()}
    return [name for name, kind in made.items() if kind.instant_contacts]
