"""Identification: estimators, smoothing, and their settings."""
