"""Settings of small runs of training, and what they leave."""

import csv

SMALL = {
    "total_steps": 16_384,
    "num_worlds": 32,
    "batch_size": 256,
    "evaluations": 2,
    "eval_episodes": 10,
}


def rows(folder):
    """The evaluations of a run."""
    with (folder / "evaluations.csv").open() as file:
        return list(csv.DictReader(file))
