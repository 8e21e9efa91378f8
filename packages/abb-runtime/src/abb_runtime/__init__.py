"""What programs for ABB controllers need of the machine: connections, clocks, processes, settings."""

from abb_protocols.catalogue import add_texts

__version__ = "0.1.0"

add_texts("abb_runtime.texts")
