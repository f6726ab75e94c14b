"""Helpers for drafts of rig files and protocols."""
