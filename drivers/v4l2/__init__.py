"""Video4Linux2 cameras: verified settings, and frames exposed after they were asked for.

Start with `camera`, the public class; then `session`, `capture` and `frame_filter`.
"""
