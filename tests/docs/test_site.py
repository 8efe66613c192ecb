"""The navigation of the site and the pages of its reference."""

import re
from importlib import import_module

import yaml
from written import DOCS, GENERATED, PAGES, ROOT


class Loader(yaml.SafeLoader):
    """Loader that skips the Python names of mkdocs."""


Loader.add_multi_constructor("tag:yaml.org,2002:python/", lambda *_: None)


def pages_of(entry):
    """Yield the paths in an entry of the navigation."""
    if isinstance(entry, str):
        yield entry
    else:
        for value in entry.values() if isinstance(entry, dict) else entry:
            yield from pages_of(value)


def test_the_navigation_has_every_page_once():
    config = yaml.load((ROOT / "mkdocs.yml").read_text(), Loader)
    listed = sorted(DOCS / page for page in pages_of(config["nav"]))
    assert listed == sorted({*DOCS.rglob("*.md"), *GENERATED})


def shown(module, name):
    """Return the names under which the reference may have a public name."""
    home = getattr(getattr(import_module(module), name), "__module__", module)
    return {place for m in (module, home) for place in (m, f"{m}.{name}")}


def test_the_reference_has_every_name_that_the_docs_import():
    reference = "".join(path.read_text() for path in (DOCS / "api").glob("*.md"))
    entries = set(re.findall(r"^::: (\S+)", reference, re.MULTILINE))
    line = re.compile(r"from (marl_airhockey\.[\w.]+) import (?:\(([^)]*)\)|(.*))")
    imported = {
        (module, name)
        for page in PAGES
        for module, several, some in line.findall(page.read_text())
        for name in re.findall(r"\w+", several or some)
        if not module.startswith("marl_airhockey.scenarios.")
    }
    assert [pair for pair in sorted(imported) if not shown(*pair) & entries] == []
