"""The examples of the documentation run, and every public name has some documentation."""

from __future__ import annotations

import doctest
import importlib
from pathlib import Path

import pytest

import gpsindy

#: Every module with an example that needs nothing but numpy.
SOURCE = Path(gpsindy.__file__).parent
TEXTS = {file.relative_to(SOURCE.parent): file.read_text(encoding="utf-8") for file in sorted(SOURCE.rglob("*.py"))}
FILES = [file for file, text in TEXTS.items() if ">>> " in text and "+SKIP" not in text]
MODULES = [".".join(file.with_suffix("").parts).removesuffix(".__init__") for file in FILES]


@pytest.mark.parametrize("name", MODULES)
def test_examples_run(name):
    failed, attempted = doctest.testmod(importlib.import_module(name))
    assert failed == 0 and attempted > 0


@pytest.mark.parametrize("name", gpsindy.__all__)
def test_every_public_name_is_documented(name):
    thing = getattr(gpsindy, name)
    assert thing.__doc__
    if isinstance(thing, type):
        for member, value in vars(thing).items():
            if not member.startswith("_") and (callable(value) or isinstance(value, property)):
                assert value.__doc__, f"{name}.{member}"
