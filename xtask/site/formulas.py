"""Formulas between dollars become MathML, which browsers draw without script: `python formulas.py FOLDER`."""

import pathlib
import re
import sys

from latex2mathml.converter import convert

for page in pathlib.Path(sys.argv[1]).rglob("*.md"):
    text = page.read_text(encoding="utf-8")
    # Code keeps its dollars.
    parts = re.split(r"(```.*?```|`[^`\n]*`)", text, flags=re.DOTALL)
    for k in range(0, len(parts), 2):
        parts[k] = re.sub(r"\$\$(.+?)\$\$", lambda m: convert(m[1].strip(), display="block"), parts[k], flags=re.DOTALL)
        # Within an inline element: a line that begins with `<math` would end its paragraph and its list.
        parts[k] = re.sub(r"\$([^$\n]+(?:\n[^$\n]+)?)\$", lambda m: f"<span>{convert(m[1])}</span>", parts[k])
    page.write_text("".join(parts), encoding="utf-8")
