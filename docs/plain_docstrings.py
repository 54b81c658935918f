"""For the site: docstrings here are plain text, so `<task>/<name>` is no HTML tag and `[a][b]` no link."""

import re
from typing import Any

import griffe

CODE = re.compile(r"(`[^`]*`)")


class PlainDocstrings(griffe.Extension):
    """Escapes what Markdown would take for a tag or a link, outside `code`; a module's may hold indented commands."""

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        if obj.docstring and not obj.is_module:
            pieces = CODE.split(obj.docstring.value)
            pieces[::2] = [re.sub(r"<(?=[a-z])", "&lt;", text).replace("[", "\\[") for text in pieces[::2]]
            obj.docstring.value = "".join(pieces)
