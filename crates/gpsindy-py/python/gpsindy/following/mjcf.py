"""Corrections written into the text of an MJCF file: comments, order and layout stay as they are."""

from __future__ import annotations

import os
import pathlib
import posixpath
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from xml.parsers import expat

_ACTUATORS = frozenset(
    {"general", "motor", "position", "velocity", "intvelocity", "damper", "cylinder", "muscle", "adhesion", "dcmotor"}
)


@dataclass
class Element:
    """A start tag in the text: where it is and what it says."""

    tag: str
    start: int
    attributes: dict[str, str]
    parent: int
    children: list[int] = field(default_factory=list)


class Text:
    """An MJCF text that is edited in place.

    Attributes
    ----------
    text : str
        As it is now.
    """

    def __init__(self, text: str) -> None:
        self.text = text
        self._read()

    def _read(self) -> None:
        data = self.text.encode("utf-8")
        self._elements: list[Element] = []
        stack: list[int] = []
        parser = expat.ParserCreate("utf-8")

        def begin(tag: str, attributes: dict[str, str]) -> None:
            start = len(data[: parser.CurrentByteIndex].decode("utf-8"))
            parent = stack[-1] if stack else -1
            self._elements.append(Element(tag, start, attributes, parent))
            if parent >= 0:
                self._elements[parent].children.append(len(self._elements) - 1)
            stack.append(len(self._elements) - 1)

        parser.StartElementHandler = begin
        parser.EndElementHandler = lambda _tag: stack.pop()
        parser.Parse(data, True)

    def _within(self, index: int, tag: str) -> bool:
        while index >= 0:
            if self._elements[index].tag == tag:
                return True
            index = self._elements[index].parent
        return False

    def find(self, kind: str, name: str, number: int) -> Element | None:
        """The ``joint``, ``body`` or ``actuator`` with this name; where it has none, the one of this number.

        The number counts only in a file that includes no other and repeats nothing.
        """
        tags = _ACTUATORS if kind == "actuator" else {kind}
        section = "actuator" if kind == "actuator" else "worldbody"
        found = [
            element
            for i, element in enumerate(self._elements)
            if element.tag in tags and self._within(element.parent, section) and not self._within(i, "default")
        ]
        for element in found:
            if element.attributes.get("name") == name:
                return element
        if any(element.tag in ("include", "replicate", "attach") for element in self._elements):
            return None
        unnamed = 0 <= number < len(found) and "name" not in found[number].attributes
        return found[number] if unnamed else None

    def set(self, element: Element, attribute: str, value: str) -> None:
        """Sets an attribute of a start tag."""
        end = _tag_end(self.text, element.start)
        tag = self.text[element.start : end]
        pattern = re.compile(rf"(\s{re.escape(attribute)}\s*=\s*)(\"[^\"]*\"|'[^']*')")
        if pattern.search(tag):
            tag = pattern.sub(lambda m: f'{m.group(1)}"{value}"', tag, count=1)
        else:
            close = re.search(r"\s*/?>$", tag)
            place = close.start() if close else len(tag)
            tag = f'{tag[:place]} {attribute}="{value}"{tag[place:]}'
        self.text = self.text[: element.start] + tag + self.text[end:]
        self._read()

    def unset(self, element: Element, attribute: str) -> None:
        """Takes an attribute out of a start tag, where it is there."""
        end = _tag_end(self.text, element.start)
        tag = re.sub(rf"\s{re.escape(attribute)}\s*=\s*(\"[^\"]*\"|'[^']*')", "", self.text[element.start : end], count=1)
        self.text = self.text[: element.start] + tag + self.text[end:]
        self._read()

    def remove(self, element: Element) -> None:
        """Takes out an element that holds no other, with its line where it has one of its own."""
        start, end = element.start, _tag_end(self.text, element.start)
        if not self.text[:end].endswith("/>"):
            end = self.text.index(">", self.text.index(f"</{element.tag}", end)) + 1
        before, after = self.text[:start], self.text[end:]
        if re.search(r"\n[ \t]*$", before) and re.match(r"[ \t]*\n", after):
            before = re.sub(r"\n[ \t]*$", "", before)
        self.text = before + after
        self._read()

    def named(self, tag: str) -> list[Element]:
        """All elements with a tag, in their order."""
        return [element for element in self._elements if element.tag == tag]

    def child(self, element: Element, tag: str) -> Element | None:
        """The first element ``tag`` directly within another one."""
        children = (self._elements[i] for i in element.children)
        return next((child for child in children if child.tag == tag), None)

    def insert(self, element: Element, line: str) -> None:
        """Puts a line right behind a start tag, indented below it; an empty element is opened for it."""
        end = _tag_end(self.text, element.start)
        margin = re.search(r"[ \t]*$", self.text[: element.start])
        indent = (margin.group() if margin else "") + "  "
        if self.text[: end].endswith("/>"):
            opened = re.sub(r"\s*/>$", ">", self.text[element.start : end])
            closing = f"\n{indent[:-2]}</{element.tag}>"
            self.text = f"{self.text[: element.start]}{opened}\n{indent}{line}{closing}{self.text[end:]}"
        else:
            self.text = f"{self.text[:end]}\n{indent}{line}{self.text[end:]}"
        self._read()

    def comment(self, lines: Sequence[str]) -> None:
        """Comments at the top of the model."""
        for line in reversed(lines):
            self.insert(self._elements[0], f"<!-- {re.sub('-{2,}', '- -', line)} -->")


def moved(text: str, home: pathlib.Path, folder: pathlib.Path) -> str:
    """The text of a file of the folder ``home`` for another one: what it names by relative paths is found from there.

    Meshes, height fields and textures are found through the ``compiler`` element, included files by their own names.
    """
    way = os.path.relpath(home, folder).replace(os.sep, "/")
    if way == ".":
        return text
    edited = Text(text)

    def relative(element: Element, attribute: str) -> str | None:
        path = element.attributes.get(attribute)
        return None if path is None or pathlib.PurePath(path).is_absolute() else posixpath.join(way, path)

    for number_of in range(len(edited.named("include"))):
        element = edited.named("include")[number_of]
        path = relative(element, "file")
        if path is not None:
            edited.set(element, "file", path)
    if any("file" in element.attributes for tag in ("mesh", "hfield", "texture", "skin") for element in edited.named(tag)):
        if not edited.named("compiler"):
            edited.insert(edited.named("mujoco")[0], "<compiler/>")
        own = edited.named("compiler")[0].attributes
        for attribute in ["assetdir"] if "assetdir" in own else ["meshdir", "texturedir"]:
            compiler = edited.named("compiler")[0]
            edited.set(compiler, attribute, relative(compiler, attribute) or own.get(attribute, way))
    return edited.text


def number(value: float) -> str:
    """All digits that a double has, and no more."""
    return repr(float(value))


def _tag_end(text: str, start: int) -> int:
    """Where the start tag that begins at ``start`` ends; a ``>`` within quotes does not count."""
    quote = ""
    for i in range(start, len(text)):
        character = text[i]
        if quote:
            quote = "" if character == quote else quote
        elif character in "\"'":
            quote = character
        elif character == ">":
            return i + 1
    return len(text)
