"""Build docs/leaderboard.md from the cards in docs/leaderboard, the best first.

python scripts/reproduce/leaderboard.py
"""

from __future__ import annotations

from pathlib import Path

import typer

from marl_airhockey.evaluation.challenge import PROFILES
from marl_airhockey.evaluation.challenge_report import PROTOCOL, ChallengeReport

DOCS = Path(__file__).parents[2] / "docs"
PARTS = (*PROFILES, "tasks", "duel")
HEAD = f"""# Leaderboard

`airhockey challenge POLICY` plays the ten tasks in three profiles, whose physics and
senses are drawn anew for each episode, and duels against a fixed field, and writes a
card. What is not played counts as 0. Nothing is signed: a card names the version and
the SHA-256 of each policy's file, so that everybody can play it again.

To add yours: run the command with your policies in a folder (`juggle.npz`,
`juggle_ur5e.npz` ..., `duel.npz`), copy `card.json` to `docs/leaderboard/<name>.json`,
run `python scripts/reproduce/leaderboard.py`, and open a pull request with both files
and a link to the policies.

Protocol {PROTOCOL}; means with 95 % intervals. {", ".join(PROFILES)}: success in the
ten tasks in the profile; tasks: in all; duel: share of won games.
"""


def main() -> None:
    """Read the cards, write the page."""
    cards = {
        path: ChallengeReport.from_json(path.read_text())
        for path in sorted((DOCS / "leaderboard").glob("*.json"))
    }
    lines = [HEAD, f"| player | {' | '.join(PARTS)} |", "| --- " * 6 + "|"]
    best_first = sorted(cards.items(), key=lambda item: -item[1].totals["tasks"][0])
    for path, card in best_first:
        shares = [
            f"{mean:.3f} ({low:.3f}..{high:.3f})"
            for mean, low, high in (card.totals[part] for part in PARTS)
        ]
        name = f"[{card.name}](leaderboard/{path.name})"
        lines.append(f"| {name} | {' | '.join(shares)} |")
    (DOCS / "leaderboard.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    typer.run(main)
