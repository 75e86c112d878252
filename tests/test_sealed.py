"""Objects that know when they were altered."""

import json
from typing import Any

import pytest

from bayesgrasp.sealed import CHECKSUM, sealed, unsealed

CONTENT: dict[str, Any] = {"b": [1, 2.5, None], "a": {"text": "\u00fc", "nested": [[]]}}


def test_what_was_sealed_is_read_back_whatever_its_layout() -> None:
    again = json.loads(json.dumps(sealed(CONTENT), sort_keys=True, indent=3))
    assert unsealed(again) == CONTENT
    assert sealed(sealed(CONTENT)) == sealed(CONTENT)


def test_every_alteration_is_found() -> None:
    text = json.dumps(sealed(CONTENT))
    found = 0
    for place in range(len(text)):
        altered = text[:place] + chr(ord(text[place]) ^ 1) + text[place + 1 :]
        try:
            content = json.loads(altered)
        except ValueError:
            continue
        if content == sealed(CONTENT) or CHECKSUM not in content:
            continue
        with pytest.raises(ValueError, match="altered or damaged"):
            unsealed(content)
        found += 1
    assert found > 60


def test_a_missing_checksum_is_refused_unless_told_otherwise() -> None:
    assert unsealed(CONTENT, required=False) == CONTENT
    with pytest.raises(ValueError, match="no checksum"):
        unsealed(CONTENT)
