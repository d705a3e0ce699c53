"""Exceptions and warnings, in addition to those of the compiled part."""

from __future__ import annotations


class NotFittedError(ValueError, AttributeError):
    """A fitted attribute was asked for before ``fit``."""


class DataWarning(UserWarning):
    """The data can be read but are likely not what was meant."""
