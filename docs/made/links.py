"""Links of pages to files of the repository, which are not part of the site.

Where the pages are read in the repository, such links lead to the file. The site has no address of the repository to send a
reader to, so there the path itself is shown in the place of the link. A link to what is not there stops the build.
"""

import posixpath
import re
from pathlib import Path
from typing import Any

_LINK = re.compile(r"(?<!!)\[(?P<text>[^\]\n]+)\]\((?P<target>[^)\s#]+)(?P<anchor>#[^)\s]*)?\)")
_FENCE = re.compile(r"^(```.*?^```)", flags=re.DOTALL | re.MULTILINE)


def on_page_markdown(markdown: str, *, page: Any, files: Any, config: Any, **_: object) -> str:
    """The page's text as the site shows it."""
    root = Path(config.config_file_path).parent
    pages = {file.src_uri for file in files if file.inclusion.is_included()}
    folder = posixpath.dirname(f"docs/{page.file.src_uri}")
    prose = _FENCE.split(markdown)
    prose[::2] = [without_links(part, folder, pages, root) for part in prose[::2]]
    return "".join(prose)


def without_links(text: str, folder: str, pages: set[str], root: Path) -> str:
    """A text in which what leads out of the site is told by its path.

    Args:
        text: Markdown without blocks of code.
        folder: the page's folder, from the root of the repository.
        pages: what the site has, from `docs`.
        root: the root of the repository.

    Raises:
        FileNotFoundError: a link leads nowhere.
    """

    def shown(link: re.Match[str]) -> str:
        target = link["target"]
        if "://" in target or target.startswith("mailto:"):
            return link[0]
        path = posixpath.normpath(posixpath.join(folder, target))
        if path.removeprefix("docs/") in pages:
            return link[0]
        if path.startswith("..") or not (root / path).exists():
            raise FileNotFoundError(f"{folder}: [{link['text']}]({target}) leads to {path}, which is not there")
        told = link["text"].strip("`")
        return f"`{path}`" if path.endswith(told) else f"{link['text']} (`{path}`)"

    return _LINK.sub(shown, text)
