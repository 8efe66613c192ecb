"""Run an experiment of BenchMARL on an air hockey game.

    python -m benchmarl_airhockey.run task=airhockey/rally algorithm=mappo

The options are those of ``benchmarl/run.py``.
"""

import sys

from benchmarl.run import hydra_experiment

import benchmarl_airhockey  # noqa: F401

if __name__ == "__main__":
    sys.argv.append("hydra.searchpath=[pkg://benchmarl_airhockey.conf]")
    hydra_experiment()
