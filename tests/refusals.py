"""What is refused, and in which words."""

import pytest

from ringsweep.errors import InputError


def refused(words, call, /, *arguments, **options):
    """The error of a call, in one line; in it these words, if any (a regular expression), are found."""
    with pytest.raises(InputError, match=words) as caught:
        call(*arguments, **options)
    assert "\n" not in str(caught.value)
    return caught.value
