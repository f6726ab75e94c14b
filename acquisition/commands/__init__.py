"""Commands of `gonio`, one module a group: start with `scan` (run, plan, resume, report)."""
