"""CITATION.cff follows the Citation File Format 1.2.0 where it uses it, and CHANGELOG.md Keep a Changelog."""

import re

import yaml
from command import ROOT

from palpate import __version__

_TOP = {"cff-version", "message", "type", "title", "abstract", "version", "license", "authors", "keywords", "references"}
_REFERENCE = {"type", "title", "authors", "journal", "volume", "issue", "start", "end", "year", "doi"}


def test_citation() -> None:
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text("utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= set(cited) <= _TOP
    assert (cited["cff-version"], cited["type"], cited["license"]) == ("1.2.0", "software", "MIT")
    assert str(cited["version"]) == __version__
    assert all(author.keys() == {"name"} for author in cited["authors"])
    (paper,) = cited["references"]
    assert {"type", "title", "authors"} <= set(paper) <= _REFERENCE
    assert [author["family-names"] for author in paper["authors"]] == ["Jacobs", "Fu", "Çavuşoğlu"]
    assert re.fullmatch(r"10\.\d{4,9}/[-._;()/:A-Za-z0-9]+", paper["doi"])
    assert isinstance(paper["year"], int)


def test_changelog() -> None:
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    assert text.startswith("# Changelog\n")
    versions = re.findall(r"^## \[(.+?)\](?: - (\d{4}-\d\d-\d\d))?$", text, re.MULTILINE)
    assert versions[0] == ("Unreleased", "")
    assert all(date for name, date in versions[1:])
    assert len(re.findall("^## ", text, re.MULTILINE)) == len(versions)
