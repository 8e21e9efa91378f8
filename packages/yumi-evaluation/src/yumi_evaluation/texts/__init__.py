"""The texts of the messages of yumi_evaluation, a file for each subject."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text
from yumi_evaluation.texts.evaluation import EVALUATION

SUBJECTS: Mapping[str, Mapping[str, Text]] = {
    "Evaluation": EVALUATION,
}
"""The texts by subject, as the documentation lists them."""
