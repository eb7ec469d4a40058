"""The package's version, in a file that every room may read."""

__version__ = "1.0.0"
