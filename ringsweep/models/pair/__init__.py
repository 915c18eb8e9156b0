"""Two masses on one belt. Files: contacts and modes, series, record, audit, model."""

from ringsweep.models.pair import checks, contact_modes, expansion, words  # noqa: F401
from ringsweep.models.pair.declaration import BeltPair

__all__ = ["BeltPair"]
