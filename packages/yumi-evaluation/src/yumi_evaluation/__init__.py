"""Experiments and measurements: how well a robot follows, and how fast the driver answers."""

from abb_protocols.catalogue import add_texts

__version__ = "0.1.0"

add_texts("yumi_evaluation.texts")
