"""Games with fixed seeds: the same bits as on all other machines."""

import json
import os
import subprocess
import sys

import pytest

from marl_airhockey.evaluation import hashes

GAMES = {game.name: game for game in hashes.games()}
SHORT = ("duel with zoo/duel", "hit_goal_velocity with random actions in ur5e")
"""Games of the short run"""
GENERIC = {
    "NUMBA_CPU_NAME": "generic",
    "NUMBA_CPU_FEATURES": "",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL",
    "OPENBLAS_CORETYPE": "Nehalem",
}
"""Environment of a process that uses the oldest processor"""


def test_every_game_has_a_known_hash():
    assert list(hashes.known()) == list(GAMES)


@pytest.mark.parametrize("name", SHORT)
def test_a_game_has_the_known_hash(name):
    assert hashes.play(GAMES[name]) == hashes.known()[name]


def test_another_game_has_another_hash():
    game = GAMES["reach with allround"]
    assert hashes.play(game, 20) == hashes.play(game, 20)
    assert hashes.play(game, 20) != hashes.play(game, 21)


def verify(*words, **variables):
    words = [sys.executable, "-m", "marl_airhockey.cli", "verify", *words]
    return subprocess.run(
        words, env={**os.environ, **variables}, text=True, capture_output=True
    )


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_all_games_have_the_known_hashes(tmp_path):
    done = verify("--out", str(tmp_path / "hashes.json"))
    assert done.returncode == 0, done.stdout
    assert json.loads((tmp_path / "hashes.json").read_text()) == hashes.known()


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_the_oldest_processor_computes_the_known_hashes():
    done = verify(**GENERIC)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_game_without_a_match_is_an_error_that_names_all():
    done = verify("--only", "chess")
    assert done.returncode != 0
    assert "duel with allround" in done.stderr
