"""Processes that have imported all they need and fork for each call; see `ready_process`."""
