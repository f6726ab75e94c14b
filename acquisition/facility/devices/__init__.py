"""Devices of a rig with the methods of bluesky's protocols; bluesky itself is not imported."""
