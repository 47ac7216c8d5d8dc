"""Where files are kept between runs."""

from pathlib import Path

import pytest

from palpate.paths import cache_folder


@pytest.mark.parametrize(
    ("own", "xdg", "folder"),
    [
        ("/own", "/xdg", "/own"),
        ("", "/xdg", "/xdg/palpate"),
        ("", "", "/home/someone/.cache/palpate"),
        ("", "relative/is/ignored", "/home/someone/.cache/palpate"),
    ],
)
def test_the_cache_is_where_the_user_wants_it(
    monkeypatch: pytest.MonkeyPatch, own: str, xdg: str, folder: str
) -> None:
    monkeypatch.setenv("HOME", "/home/someone")
    monkeypatch.setenv("PALPATE_CACHE", own)
    monkeypatch.setenv("XDG_CACHE_HOME", xdg)
    assert cache_folder() == Path(folder)
