"""Check the changes since main: lint of the changed files, and their tests.

    make check

The tests of ``marl_airhockey/sim/sensing/delay.py`` are in
``tests/sim/sensing/test_delay.py``, or in its whole folder if there is no such file. A
scenario or driver runs its part of ``tests/suites``. Use this command while editing;
``make test`` runs all short tests.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
TOOLS = Path(sys.executable).parent


def changed() -> list[Path]:
    """Return the files that differ from main, including new ones."""

    def git(*words: str) -> list[str]:
        done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True)
        return done.stdout.split()

    base = git("merge-base", "HEAD", "main") or ["HEAD"]
    names = git("diff", "--name-only", base[0])
    names += git("ls-files", "--others", "--exclude-standard")
    return sorted({ROOT / name for name in names if (ROOT / name).is_file()})


def tests_of(path: Path) -> Path | None:
    """Return the test file or folder of a changed file; None if there is none."""
    tests, inside = ROOT / "tests", path.relative_to(ROOT).parts
    if inside[0] == "tests":
        return path if path.name.startswith("test_") else None
    if inside[0] == "docs" or path.suffix == ".md":
        return tests / "docs"
    if inside[0] != "marl_airhockey" or path.suffix != ".py":
        return None
    folder = tests.joinpath(*inside[1:-1])
    own = folder / f"test_{path.stem}.py"
    places = [own, *(f for f in (folder, *folder.parents) if tests in f.parents)]
    return next((place for place in places if place.exists()), None)


def run(*command: str | Path) -> bool:
    """Run a command in the folder of the project; return True if it fails."""
    print("$", *(Path(word).name if i == 0 else word for i, word in enumerate(command)))
    return subprocess.run([*map(str, command)], cwd=ROOT, check=False).returncode != 0


def main() -> None:
    """Check all changes; the exit status is 1 if anything fails."""
    files = changed()
    python = [str(path.relative_to(ROOT)) for path in files if path.suffix == ".py"]
    if not files:
        print("nothing differs from main")
        return
    failed = False
    if python:
        failed |= run(TOOLS / "ruff", "format", "--check", *python)
        failed |= run(TOOLS / "ruff", "check", *python)
        failed |= run(TOOLS / "lint-imports", "--no-logo", "--no-cache")
        failed |= run(TOOLS / "mypy")
    tests = {str(t.relative_to(ROOT)) for t in map(tests_of, files) if t is not None}
    # A folder includes its files.
    tests = {t for t in tests if str(Path(t).parent) not in tests}
    # The tests of the lab run alone, because it runs in real time.
    lab = {t for t in tests if t.startswith("tests/hardware/lab")}
    for some, workers in ((tests - lab, ("-n", "2")), (lab, ())):
        if some:
            failed |= run(TOOLS / "pytest", *workers, "-m", "not slow", *sorted(some))
    for path in files:
        if path.parent.name in ("scenarios", "drivers") and path.suffix == ".py":
            only = "tests/suites", "-m", "not slow", "--only", path.stem
            failed |= run(TOOLS / "pytest", "-n", "2", *only)
    sys.exit(failed)


if __name__ == "__main__":
    main()
