"""Refusal of words that no run of a scene can have."""

from __future__ import annotations

from collections.abc import Collection

from ringsweep.config.sections import suggestion
from ringsweep.errors import InputError
from ringsweep.models import WITH_IMPACT, model_of
from ringsweep.models.scene import Scene
from ringsweep.quantities.flags import AFTERMATHS, REGIMES
from ringsweep.quantities.units import show


def check_word(word: object, scene: Scene, varied: Collection[str] = ()) -> None:
    """Refuse a word that no run of a scene can have.

    Parameters
    ----------
    word : object
    scene : Scene
    varied : collection of str
        Paths of numbers that vary.

    Raises
    ------
    InputError
        If it is no word of a regime or of an aftermath, or none of this scene.
    """
    model = scene.structure.model
    known = model_of(scene.structure).regimes({*varied, *scene.values})
    if word not in REGIMES + AFTERMATHS:
        words = known + AFTERMATHS if scene.structure.impact else known
        raise InputError("regime", f"{show(word)} is not a regime" + suggestion(word, words))
    if word in known or (word in AFTERMATHS and scene.structure.impact):
        return
    if word in AFTERMATHS and model in WITH_IMPACT:
        raise InputError("regime", f"{show(word)} is said of runs that go on: it needs impact in the scene")
    also = f", with impact also {', '.join(AFTERMATHS)}" if scene.structure.impact or model in WITH_IMPACT else ""
    raise InputError(
        "regime", f"no run of this scene can be {show(word)}: those of model {model} are {', '.join(known)}{also}"
    )
