"""Tests of maps in three channels."""
