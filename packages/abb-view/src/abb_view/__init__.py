"""ABB controllers in the browser: a page with robots in 3-D, and the shell on which other pages are built."""

from abb_protocols.catalogue import add_texts

__version__ = "0.1.0"

add_texts("abb_view.texts")
