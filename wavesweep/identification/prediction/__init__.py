"""The fit of a device by the errors of predictions; begin with `fitting.py`."""
