"""Following a run for its page: the record and the scan's state become messages on a board.

Start with `follower`; `board` holds what every browser is shown.
"""
