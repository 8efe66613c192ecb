"""Names in backticks and commands in README and docs exist."""

import ast
import csv
import re
import shlex
from dataclasses import fields
from functools import cache

import pytest
import typer.main
from written import PAGES, ROOT

import marl_airhockey as ah
from marl_airhockey.cli.main import app
from marl_airhockey.learn.hindsight.config import HindsightConfig
from marl_airhockey.learn.offline.config import OfflineConfig
from marl_airhockey.learn.ppo_config import PPOConfig
from marl_airhockey.sim.contracts.observable import OBSERVE
from marl_airhockey.sim.core.parameters import PARAMETERS
from marl_airhockey.sim.world.keywords import Keywords

CODE = ("marl_airhockey", "scenarios", "drivers", "scripts", "tests")
SPAN = re.compile(r"(?<!`)`([^`\n]+)`(?!`)")
COMMAND = re.compile(
    r"^\s*(?:\$ )?((?:airhockey|python scripts/\S+|make(?= [a-z])) .*?)(?:  +#.*|&)?$"
)
WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
FILE = re.compile(r"\.(?:py|pyi|md|js|csv|json|toml|npz|png|gif|parquet|pdf|onnx|zip)$")
PLACES = ["", "docs", "marl_airhockey", "tests", "marl_airhockey/hardware/robot"]
"""Folders in which files that pages name are looked for"""
FOREIGN = {
    *("GymEnv", "PettingZooWrapper", "peft", "return_state", "team_k"),
    *("servoC", "stopJ", "stopL", "triggerProtectiveStop"),
    *("X", "Forwarded", "For", "gentle", "my_table", "MyDriver", "MyTask"),
}
"""Names of other programs and libraries, and of examples"""


def spans(page):
    """Return the names in backticks of a page, but for its blocks of code."""
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.M | re.S)
    lines = [line for line in text.splitlines() if not line.startswith("    ")]
    paragraphs = re.split(r"\n(?=\n|[|*#]|- |\d+\. )", "\n".join(lines))
    return [s for part in paragraphs for s in SPAN.findall(" ".join(part.split()))]


def commands(page):
    """Return the command lines of a page: of its blocks, and in backticks."""
    text = page.read_text().replace("\\\n", " ")
    found = [m[1] for line in text.splitlines() if (m := COMMAND.match(line))]
    found += [s for s in spans(page) if COMMAND.match(s)]
    return [part.strip() for line in found for part in line.split("&&")]


@cache
def words():
    """Return all names and all words of texts in the code, but for docstrings."""
    found = set(PARAMETERS) | set(Keywords.__annotations__)
    for folder in CODE:
        for path in (ROOT / folder).rglob("*"):
            if path.suffix == ".py":
                found |= words_of_python(path)
            elif path.suffix in (".js", ".css", ".html", ".toml"):
                found |= set(WORD.findall(path.read_text()))
    for path in (ROOT / "docs/data").iterdir():
        if path.suffix == ".csv":
            with path.open() as file:
                rows = list(csv.reader(file))
            found |= {cell for row in rows for cell in row}
        elif path.suffix == ".json":
            found |= set(WORD.findall(path.read_text()))
    for name in ("pyproject.toml", "Makefile"):
        found |= set(WORD.findall((ROOT / name).read_text()))
    for observe in OBSERVE:
        for scenario in ah.scenario_names():
            found |= {
                part for x in labels(scenario, observe) for part in WORD.findall(x)
            }
    return found


def words_of_python(path):
    tree = ast.parse(path.read_text())
    found = {path.stem, *(part.name for part in path.parents)}
    docstrings = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            docstrings.add(id(node.value))
        for name in ("id", "attr", "arg", "name", "module", "asname"):
            value = getattr(node, name, None)
            if isinstance(value, str):
                found |= set(WORD.findall(value))
        text = isinstance(node, ast.Constant) and isinstance(node.value, str)
        if text and id(node) not in docstrings:
            found |= set(WORD.findall(node.value))
    return found


@cache
def labels(scenario, observe):
    """Return the labels of an observation; none where a scenario has no such form."""
    try:
        env = ah.parallel_env(scenario, observe=observe)
    except ValueError:
        return ()
    return env.observation_labels(env.possible_agents[0])


@cache
def all_labels():
    every = {x for o in OBSERVE for s in ah.scenario_names() for x in labels(s, o)}
    # Indices differ from scenario to scenario.
    return every | {re.sub(r"_\d+", "", x) for x in every}


@cache
def sources():
    paths = [p for folder in CODE for p in (ROOT / folder).rglob("*.py")]
    paths += (ROOT / "marl_airhockey").rglob("*.js")
    return "\n".join(path.read_text() for path in paths)


def is_file(span):
    """Return True if a span is a path of the project; capitals are any word."""
    if span.startswith(("/", "~", "-")):
        return False
    pattern = re.sub(r"(?<![a-z])[A-Z][A-Z]+", "*", span.removeprefix("./").rstrip("/"))
    for place in PLACES:
        for ending in ("", ".py", ".npz"):
            if any((ROOT / place).glob(pattern + ending)):
                return True
    return bool(FILE.search(span)) and any(
        path.name == span for folder in CODE for path in (ROOT / folder).rglob(span)
    )


def blocks(page):
    """Return the words of a page's blocks of code."""
    text = page.read_text()
    lines = [line for line in text.splitlines() if line.startswith("    ")]
    fenced = re.findall(r"^```.*?^```", text, flags=re.M | re.S)
    return set(WORD.findall("\n".join([*lines, *fenced])))


def exists(span, own):
    """Return whether what a span names is there, or in a page's ``own`` blocks."""
    if COMMAND.match(span) or is_file(span) or span in all_labels():
        return True
    if re.match(r"(own|puck|goal|block)[a-z_0-9]*\.", span):
        return any(label.startswith(span) for label in all_labels())
    dotted = re.fullmatch(r"[a-z_]+(?:\.[a-z_]+)+", span)
    if dotted and not FILE.search(span):
        head, _, tail = span.rpartition(".")
        owner = head.split(".")[0]
        shown = owner in ("ah", "env", "world", "device") and tail in words()
        return span in sources() or shown
    known = words() | FOREIGN | own
    return all(word in known or word.isupper() for word in WORD.findall(span))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_name_in_backticks_exists(page):
    own = blocks(page)
    unknown = sorted({span for span in spans(page) if not exists(span, own)})
    assert not unknown, unknown


@cache
def command_line():
    """Return the command ``airhockey``, which takes long to build."""
    return typer.main.get_command(app)


@cache
def options_of(words):
    """Return the options of a command of ours, by the words that name it."""
    found, known = command_line(), set()
    for word in words:
        known |= {name for p in found.params for name in (*p.opts, *p.secondary_opts)}
        if not hasattr(found, "commands") or word not in found.commands:
            break
        found = found.commands[word]
    return known | {n for p in found.params for n in (*p.opts, *p.secondary_opts)}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_command_and_option_exists(page):
    for line in commands(page):
        given = shlex.split(line.replace("...", ""))
        options = {word.partition("=")[0] for word in given if word.startswith("-")}
        options -= {"-", "--"}
        if given[0] == "airhockey":
            groups = command_line().commands
            named = [word for word in given[1:] if not word.startswith("-")]
            if named and not named[0].isupper():
                assert named[0] in groups, line
            assert options <= options_of(tuple(named[:2])) | {"--help"}, line
        elif given[0] == "make":
            targets = set(
                re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), re.M)
            )
            named = {word for word in given[1:] if "=" not in word}
            assert named <= targets, line
        else:
            text = (ROOT / given[1]).read_text()
            for option in options - {"--help"}:
                name = option.removeprefix("--").replace("-", "_")
                there = option in text or re.search(rf"\b{name}: ", text)
                shared = name in ("again", "rows") and "RowsFile" in text
                assert there or shared, line


def test_every_keyword_of_an_environment_is_on_its_page():
    text = (ROOT / "docs/environments.md").read_text()
    section = text.split("## Keywords")[1].split("\n## ")[0]
    named = set(re.findall(r"^\| `([a-z_]+)` \|", section, re.MULTILINE))
    keywords = {*Keywords.__annotations__, "render_mode", "viewpoint"}
    assert keywords == named


@pytest.mark.parametrize("config", [PPOConfig, HindsightConfig, OfflineConfig])
def test_every_training_setting_is_on_a_page(config):
    pages = ("training", "offline", "games")
    named = {s for name in pages for s in spans(ROOT / f"docs/{name}.md")}
    told = {word for span in named for word in WORD.findall(span)}
    missing = sorted({field.name for field in fields(config)} - told)
    assert not missing, missing
