"""Protocol, plan, engine, record; exposure, window, radiometry; the command line."""
