"""The examples of the documentation run, and every public name has some documentation."""

from __future__ import annotations

import doctest
import importlib

import pytest

import gpsindy

NAMES = (
    "data.dataset",
    "diagnosis",
    "identifying.estimator",
    "identifying.online",
    "identifying.smoothing",
    "model",
    "scoring",
    "simulation",
)
MODULES = ["gpsindy", *(f"gpsindy.{name}" for name in NAMES)]


@pytest.mark.parametrize("name", MODULES)
def test_examples_run(name):
    failed, _ = doctest.testmod(importlib.import_module(name))
    assert failed == 0


@pytest.mark.parametrize("name", gpsindy.__all__)
def test_every_public_name_is_documented(name):
    thing = getattr(gpsindy, name)
    assert thing.__doc__
    if isinstance(thing, type):
        for member, value in vars(thing).items():
            if not member.startswith("_") and (callable(value) or isinstance(value, property)):
                assert value.__doc__, f"{name}.{member}"
