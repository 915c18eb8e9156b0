"""Belts of one kind: tests whose claims do not depend on the parts of a belt share one kernel for each law."""


def with_all_parts(scene):
    """A scene on a belt of constant velocity, with cubic spring, damper and force; those that it lacks are 0."""
    spring, damper = {"cubic": 0.0} | scene["spring"], {"coefficient": 0.0} | scene.get("damper", {})
    # A force without a frequency has no period, and leaves the motion a free one.
    force = {"amplitude": 0.0, "frequency": 0.0} | scene.get("force", {})
    return scene | {"spring": spring, "damper": damper, "force": force}
