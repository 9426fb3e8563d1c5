"""The README as the description of the package, whose links lead to the project's public place."""

import re
from pathlib import Path

from hatchling.metadata.plugin.interface import MetadataHookInterface


def with_absolute_links(text: str, place: str) -> str:
    """The text with its links and pictures within the project as addresses below `place`."""
    return re.sub(r"(\]\()(?!https?:|mailto:|#)", rf"\g<1>{place}/", text)


class CustomMetadataHook(MetadataHookInterface):
    """What a page of packages shows, which has none of the project's files beside it."""

    def update(self, metadata: dict) -> None:
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        place = metadata["urls"]["Homepage"]
        metadata["readme"] = {
            "content-type": "text/markdown",
            "text": with_absolute_links(text, place),
        }
