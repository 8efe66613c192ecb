"""Cards of policies: the facts that travel with them, by the names of this version."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

OLD_LABELS = {
    "own.asked[": "own.requested[",
    "own.then.": "own.delayed.",
    ".now.": ".predicted.",
}
"""Parts of the labels of observations by those of earlier versions"""


def current_card(card: Mapping[str, Any]) -> dict[str, Any]:
    """Return a card whose labels of observations are those of this version.

    Args:
        card: Card of a policy from a file.
    """
    labels = card.get("labels")
    if not isinstance(labels, list):
        return dict(card)
    return {**card, "labels": [_current(str(label)) for label in labels]}


def _current(label: str) -> str:
    for old, new in OLD_LABELS.items():
        label = label.replace(old, new)
    return label
