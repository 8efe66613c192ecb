#!/usr/bin/env bash
# Check a GPU, in less than 8 minutes: worlds on the GPU have the bits of the CPU, their
# speed, and that the same code as on the CPU learns the same, and how fast. Run it in a
# checkout whose Python has torch for CUDA, and the extra cuda.
set -euo pipefail
cd "$(dirname "$0")/.."
python=${PYTHON:-.venv/bin/python}
out=$(mktemp -d)
nvidia-smi --query-gpu=name,memory.total --format=csv,noheader
"$python" -m pytest -q tests/learn/test_device.py
"$python" scripts/bench/gpu.py --out "$out/gpu.json"
cat "$out/gpu.json"
for device in cpu cuda; do
    "$python" -m marl_airhockey.cli.main train juggle --device "$device" --out "$out/$device"
done
"$python" -m marl_airhockey.cli.main data get airhockey/touch/medium-v0 --out "$out/medium"
"$python" -m marl_airhockey.cli.main train touch --algo iql --data "$out/medium" \
    --device cuda --steps 2000 --out "$out/iql"
"$python" scripts/bench/train_speed.py --rounds 1
rm -r "$out"
