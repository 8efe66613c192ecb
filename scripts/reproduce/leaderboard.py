"""Build docs/leaderboard.md from the cards in docs/leaderboard, the best first.

python scripts/reproduce/leaderboard.py
"""

from __future__ import annotations

from pathlib import Path

import typer
from rows import DATA, read

from marl_airhockey.evaluation.challenge import FIELD, PROFILES
from marl_airhockey.evaluation.challenge_report import (
    PARTS,
    PROTOCOL,
    ChallengeReport,
)
from marl_airhockey.evaluation.population import SHA256

DOCS = Path(__file__).parents[2] / "docs"
COLUMNS = (*PROFILES, *PARTS)
HEAD = f"""# Leaderboard

This page compares policies by a fixed protocol, number {PROTOCOL}.
`airhockey challenge POLICY` plays the protocol and writes a card with the results.

- Tasks: the ten tasks in each of the profiles {", ".join(PROFILES)}.
  In ur5e and gantry, physics and sensing are sampled for each episode.
- Duels: games against {", ".join(FIELD)}.
- Population: games against eight players of different styles, see below.
- Set pieces: the suites of [set pieces](set_pieces.md).
- What has no policy counts as 0.
- A card contains the version of the library and the SHA-256 of each policy file, so
  that anyone can measure the policies again. It is not signed.

All values are means with 95 % intervals. The columns with the name of a profile show
the success in the ten tasks in that profile, and "tasks" the success in all profiles.
"duel" and "population" are shares of won games, in which a draw counts half. "set
pieces" is the mean success in the suites.
"""
TAIL = f"""
## The population

The eight players were trained with seeds that are published nowhere, so that no policy
can be trained against copies of them. Please do not train against their files either.
The SHA-256 of all files is checked first:

    {SHA256}

STYLES

    python scripts/reproduce/population.py

This prints the styles in games against zoo/duel. Bank shots are the share of the goals
after a wall bounce.

## Add your policies

1. Put the policies into a folder: `juggle.npz`, `juggle_ur5e.npz`, ..., `duel.npz`.
2. Run `airhockey challenge FOLDER`.
3. Copy `card.json` to `docs/leaderboard/<name>.json`.
4. Run `python scripts/reproduce/leaderboard.py`.
5. Open a pull request with both files and a link to the policies.
"""


def main() -> None:
    """Write the page."""
    (DOCS / "leaderboard.md").write_text(page())


def page() -> str:
    """Return the page, from the cards and the rows of the population."""
    cards = {
        path: ChallengeReport.from_json(path.read_text())
        for path in sorted((DOCS / "leaderboard").glob("*.json"))
    }
    lines = [HEAD, f"| player | {' | '.join(COLUMNS)} |", "| --- " * 8 + "|"]
    best_first = sorted(cards.items(), key=lambda item: -item[1].totals["tasks"][0])
    for path, card in best_first:
        shares = [
            f"{mean:.3f} ({low:.3f}..{high:.3f})"
            for mean, low, high in (card.totals[column] for column in COLUMNS)
        ]
        name = f"[{card.name}](leaderboard/{path.name})"
        lines.append(f"| {name} | {' | '.join(shares)} |")
    tail = TAIL.replace("STYLES", "\n".join(styles()))
    return "\n".join([*lines, tail])


def styles() -> list[str]:
    """Return the table of the styles of the population."""
    lines = [
        "| style | score | goals | goals per minute | bank shots |",
        "| --- | --- | --- | --- | --- |",
    ]
    for row in read(DATA / "population.csv"):
        goals = f"{float(row['home_goals']):.1f} : {float(row['far_goals']):.1f}"
        numbers = (
            f"{float(row['goals_per_minute']):.1f}",
            f"{float(row['bank_shots']):.2f}",
        )
        cells = row["style"], f"{float(row['score']):.2f}", goals, *numbers
        lines.append(f"| {' | '.join(cells)} |")
    return lines


if __name__ == "__main__":
    typer.run(main)
