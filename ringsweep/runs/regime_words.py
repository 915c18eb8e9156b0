"""Words that runs of a scene can have."""

from __future__ import annotations

from collections.abc import Collection

from ringsweep.config.sections import suggestion
from ringsweep.errors import InputError
from ringsweep.models import WITH_IMPACT
from ringsweep.models.scene import Scene
from ringsweep.quantities.flags import AFTERMATHS, REGIMES
from ringsweep.quantities.units import show

_RING = ("resting", "oscillatory", "revolving", "separating", "jammed", "failed")
_BELT = ("stick-slip", "oscillatory", "sliding", "sticking", "riding", "failed")


def regimes_of(scene: Scene, varied: Collection[str] = ()) -> tuple[str, ...]:
    """Regimes that runs of a scene can have if some of its numbers vary; all, of a model from elsewhere."""
    model = scene.structure.model
    if model in ("ring", "ring-single-contact"):
        return _RING
    if model != "belt":
        return REGIMES
    # Only a load that changes with the displacement can fall to zero.
    changes = "body.normal_stiffness" in {*varied, *scene.values}
    return (*_BELT[:-1], "separating", "failed") if changes else _BELT


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
    model, known = scene.structure.model, regimes_of(scene, varied)
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
