"""For mkdocs: the pages of docs/decisions come into the navigation by themselves."""

from pathlib import Path
from typing import Any


def on_config(config: Any) -> Any:
    """Fills the entry Decisions with all pages of that folder, by name."""
    folder = Path(config["docs_dir"]) / "decisions"
    pages = [f"decisions/{file.name}" for file in sorted(folder.glob("*.md"))]
    for entry in config["nav"]:
        if "Decisions" in entry:
            entry["Decisions"] = pages
    return config
