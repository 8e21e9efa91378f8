"""A virtual IRC5 for any ABB robot: its protocols, its mechanics, and its language RAPID."""

from abb_protocols.catalogue import add_texts

__version__ = "0.1.0"

add_texts("virtual_irc5.texts")
