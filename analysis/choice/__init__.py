"""Choice of the simplest adequate reflectance model for measurements. Open `choice.py` first."""
