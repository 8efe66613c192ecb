"""The workflows for GitHub run what there is."""

import re
import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[1]
WORKFLOWS = {
    path.stem: yaml.safe_load(path.read_text())
    for path in (ROOT / ".github/workflows").glob("*.yml")
}


def jobs():
    return [job for each in WORKFLOWS.values() for job in each["jobs"].values()]


def test_every_command_and_file_of_a_workflow_exists():
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M))
    runs = [step["run"] for job in jobs() for step in job["steps"] if "run" in step]
    made = {name for run in runs for name in re.findall(r"\bmake ([a-z-]+)", run)}
    files = {name for run in runs for name in re.findall(r"tests/\w+\.py", run)}
    assert made == {"test", "docs", "wheel"}
    assert made <= targets
    assert len(files) == 2
    assert all((ROOT / name).exists() for name in files)


def test_all_supported_pythons_are_tested_and_have_a_wheel():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    named = re.findall(r"Python :: (3\.\d+)", " ".join(project["classifiers"]))
    matrices = [job["strategy"]["matrix"] for job in jobs() if "strategy" in job]
    assert [m["python"] for m in matrices if "python" in m] == [named, named]
