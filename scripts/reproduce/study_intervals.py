"""Measure the coverage of the intervals of a study's report, by simulated studies.

    python scripts/reproduce/study_intervals.py --studies 500

Each study has 24 participants of different skill. They play three games against each of
three opponents and answer a question. Participants and opponents of all studies have
the same distributions, whose true means are known. The script prints how often the
report's intervals of score and answer contain them.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
import typer

from marl_airhockey.play.study.answers import ANSWERS, GAMES, Answers
from marl_airhockey.play.study.tables import by_opponent, by_question
from marl_airhockey.types import Array

PARTICIPANTS, GAMES_EACH = 24, 3
STRENGTHS = {"weak": -1.0, "even": 0.0, "strong": 1.2}
"""Strength of each opponent, logits."""
SPREAD = 1.0
"""Standard deviation of the participants' skills, logits."""
DRAWS = 0.15
"""Share of draws."""


def points(skill: Array, strength: float, rng: np.random.Generator) -> Array:
    """Return points of games (n, `GAMES_EACH`) of people with skills (n,)."""
    win = (1.0 - DRAWS) / (1.0 + np.exp(strength - skill))
    chance = rng.random((len(skill), GAMES_EACH))
    drawn = 0.5 * (chance < win[:, None] + DRAWS)
    return np.where(chance < win[:, None], 1.0, drawn)


def answers(skill: Array, strength: float, rng: np.random.Generator) -> Array:
    """Return answers (n,), 1 to 7, of people with skills (n,)."""
    felt = 4.0 + 0.8 * skill - 0.7 * strength + rng.normal(0.0, 1.0, len(skill))
    return np.clip(np.round(felt), 1.0, 7.0)


def simulated(rng: np.random.Generator) -> Answers:
    """Return the games and answers of a study."""
    skill = rng.normal(0.0, SPREAD, PARTICIPANTS)
    found = Answers([], [], [], PARTICIPANTS, PARTICIPANTS)
    results = {1.0: "won", 0.5: "drawn", 0.0: "lost"}
    for block, (opponent, strength) in enumerate(STRENGTHS.items()):
        scores, given = points(skill, strength, rng), answers(skill, strength, rng)
        for k in range(PARTICIPANTS):
            who = {"participant": f"p{k:02}", "number": k, "block": block + 1}
            who |= {"opponent": opponent, "practice": False}
            for score in scores[k]:
                row = dict.fromkeys(GAMES, "") | who | {"result": results[score]}
                found.games.append(row)
                found.scores.append({})
            row = dict.fromkeys(ANSWERS, "") | who | {"question": "fun"}
            found.answers.append(row | {"value": float(given[k])})
    return found


def truth() -> dict[str, tuple[float, float]]:
    """Return the true mean score and mean answer against each opponent."""
    rng = np.random.default_rng(0)
    skill = rng.normal(0.0, SPREAD, 2_000_000)
    return {
        name: (
            float(points(skill, strength, rng).mean()),
            float(answers(skill, strength, rng).mean()),
        )
        for name, strength in STRENGTHS.items()
    }


def coverage(studies: int, seed: int = 1) -> dict[str, float]:
    """Return the share of intervals that contain the truth, of scores and answers."""
    known, rng = truth(), np.random.default_rng(seed)
    hits: dict[str, list[bool]] = {"score": [], "answer": []}
    for _ in range(studies):
        found = simulated(rng)
        for row in by_opponent(found):
            _, low, high = row["score"]
            hits["score"].append(low <= known[row["opponent"]][0] <= high)
        for row in by_question(found):
            _, low, high = row["mean"]
            hits["answer"].append(low <= known[row["opponent"]][1] <= high)
    return {name: float(np.mean(values)) for name, values in hits.items()}


def main(
    studies: Annotated[int, typer.Option(help="Number of simulated studies.")] = 500,
) -> None:
    """Print the coverage."""
    for name, share in coverage(studies).items():
        count = studies * len(STRENGTHS)
        print(f"{name}: {share:.3f} of {count} intervals contain the truth")


if __name__ == "__main__":
    typer.run(main)
