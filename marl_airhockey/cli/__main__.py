"""Entry point of ``python -m marl_airhockey.cli``."""

from marl_airhockey.cli.main import main

main()
