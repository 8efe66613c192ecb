"""Real backend: a table with a camera above it and an arm at its home side."""

from marl_airhockey.backends.real.backend import RealBackend

make = RealBackend
