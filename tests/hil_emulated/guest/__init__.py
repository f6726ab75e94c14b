"""Tests that run inside the emulated computer, marked `hil`, and what they need there."""
