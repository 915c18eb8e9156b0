"""Figures of the documents are those of the kept results."""

import re

import pytest

from benchmarks import documents

DOCUMENTS = list(documents.documents())


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_figures_of_a_document_are_the_kept_ones(path):
    """`python -m benchmarks.documents` fills them in."""
    text = path.read_text()
    assert documents.filled(text, documents.kept()) == text


@pytest.mark.parametrize("path", DOCUMENTS, ids=lambda path: path.name)
def test_no_line_of_prose_begins_with_a_mark(path):
    """Markdown takes such a line for HTML, and shows its code and links as they are written."""
    assert not re.findall(r"^<!-- [\w.]+ -->.+", path.read_text(), re.MULTILINE)


def test_every_kept_figure_has_a_reader():
    named = set().union(*(documents.used(path.read_text()) for path in DOCUMENTS))
    assert named == set(documents.kept())
