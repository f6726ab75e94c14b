"""Commands about runs that have been measured."""
