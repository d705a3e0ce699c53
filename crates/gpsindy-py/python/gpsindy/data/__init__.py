"""Logs and tables, as runs of samples."""
