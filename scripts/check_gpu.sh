#!/usr/bin/env bash
# Check a GPU, in less than 8 minutes on 16 cores: worlds on it have the bits of the CPU,
# their speed, and how fast policies learn there, compared with all cores of the machine.
# Run it in a checkout whose Python has this package with the extras train, cuda and dev,
# and torch for CUDA.
set -euo pipefail
cd "$(dirname "$0")/.."
python=${PYTHON:-.venv/bin/python}
out=${OUT:-$(mktemp -d)}
export MARL_AIRHOCKEY_THREADS=$(nproc)
nvidia-smi --query-gpu=name,memory.total --format=csv,noheader
"$python" scripts/bench/gpu.py --out "$out/gpu.json"
# Evaluations are games against zoo/duel: its level is a score of 0.5.
timeout 180 "$python" -m marl_airhockey.cli.main train duel --device cuda \
    --engine device --set self_play_fraction=1 --set num_worlds=4096 \
    --set batch_size=32768 --steps 100000000 --set 'eval_opponents=["zoo/duel"]' \
    --set evaluations=10 --set eval_episodes=50 --out "$out/duel" || true
cat "$out/duel/evaluations.csv"
"$python" scripts/bench/train_speed.py --rounds 1 --scenarios duel \
    --threads "$(nproc)" --out "$out/train_speed.json"
"$python" -m pytest -q tests/learn/test_device.py
