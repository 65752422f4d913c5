"""Robot-guided optical inspection of car bodies."""

__version__ = "0.1.0"
