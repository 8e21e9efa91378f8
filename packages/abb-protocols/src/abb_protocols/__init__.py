"""Protocols of ABB controllers as calculations, EGM and Robot Web Services, and their arms as data."""

__version__ = "0.1.0"
