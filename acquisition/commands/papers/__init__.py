"""Commands about the papers that the models come from."""
