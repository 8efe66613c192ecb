"""Pages of the documentation: those that are written, and those that are generated."""

from pathlib import Path

from marl_airhockey.registry import scenario_names

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
GENERATED = {
    DOCS / "cli.md",
    *(DOCS / f"scenarios/{name}.md" for name in scenario_names()),
}
"""Pages that `make docs` writes"""
PAGES = [ROOT / "README.md", *sorted(set(DOCS.glob("*.md")) - GENERATED)]
"""README and the pages of the site that are written"""
