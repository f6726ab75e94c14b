"""Helpers for tests of rigs that other programs drive."""
