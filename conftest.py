"""For all Python tests: what the user keeps between runs is neither used nor changed."""

import os
import tempfile
from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True, scope="session")
def cache_of_its_own() -> Iterator[None]:
    with tempfile.TemporaryDirectory() as folder:
        os.environ["PALPATE_CACHE"] = folder
        yield
        del os.environ["PALPATE_CACHE"]
