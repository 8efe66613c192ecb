"""What README and pages show works as it stands there."""

import re
from pathlib import Path

import pytest
from written import GENERATED, PAGES

import marl_airhockey as ah
from marl_airhockey.data.record import record_episodes

FENCE = r"```python\n(.*?)```"
BLOCKS = {
    f"{page.stem}-{k}": block
    for page in PAGES
    for k, block in enumerate(re.findall(FENCE, page.read_text(), re.DOTALL))
}
LONG = next(name for name, block in BLOCKS.items() if "HerReplayBuffer" in block)
"""Block that trains for most of a minute."""


@pytest.mark.parametrize("name", [name for name in BLOCKS if name != LONG])
def test_a_python_block_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if name.startswith(("recordings-", "formats-")):
        # The page's first command makes a recording.
        player, path = ah.make_driver("striker"), Path("recordings/juggle")
        record_episodes(player, "striker", "juggle", 2, path, 0, {})
    exec(BLOCKS[name], {})


@pytest.mark.slow
def test_the_block_with_hindsight_learns():
    names = {}
    exec(BLOCKS[LONG], names)
    assert names["success"] > 0.5


def test_every_page_and_picture_that_pages_name_exists():
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text()):
            path = page.parent / target
            there = path.exists() or path in GENERATED
            assert there, f"{page.name}: {target}"
