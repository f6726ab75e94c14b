"""Web server of the live page, on this computer alone; start with `app`."""
