"""Every quantity of a dataset once: name, type, unit, meaning and flags."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ringsweep.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

#: Regimes in the order of their flag values; motions are the ones that can precede an end.
REGIMES = ("resting", "oscillatory", "revolving", "separating", "jammed", "failed", "stick-slip")
RESTING, OSCILLATORY, REVOLVING, SEPARATING, JAMMED, FAILED, STICK_SLIP = range(7)

MODES = {-1: "slip_backward", 0: "stick", 1: "slip_forward"}


@dataclass(frozen=True)
class Variable:
    """A quantity of a dataset; `flags` maps the values of a classification to their meanings."""

    long_name: str
    units: str = "1"
    dtype: str = "float64"
    flags: dict[int, str] | None = None

    @property
    def attributes(self) -> dict[str, Any]:
        """CF attributes."""
        import numpy as np

        attributes: dict[str, Any] = {"long_name": self.long_name, "units": self.units}
        if self.flags:
            attributes["flag_values"] = np.array(list(self.flags), dtype=self.dtype)
            attributes["flag_meanings"] = " ".join(meaning.replace(" ", "_") for meaning in self.flags.values())
        return attributes


_regimes = dict(enumerate(REGIMES))

OUTCOMES: dict[str, Variable] = {
    "regime": Variable("regime of the run", dtype="int8", flags=_regimes),
    "motion": Variable(
        "motion up to the end of the run",
        dtype="int8",
        flags={k: v for k, v in _regimes.items() if k not in (SEPARATING, JAMMED)},
    ),
    "separating_contact": Variable(
        "contact that separates", dtype="int8", flags={0: "none", 1: "contact_1", 2: "contact_2", 3: "both"}
    ),
    "t_separation": Variable("time of separation", "s"),
    "t_end": Variable("time at which the run ends", "s"),
    "phi_end": Variable("angle of the body at the end", "rad"),
    "omega_end": Variable("angular velocity of the body at the end", "rad s-1"),
    "phi_min": Variable("least angle of the body", "rad"),
    "phi_max": Variable("greatest angle of the body", "rad"),
    "omega_min": Variable("least angular velocity of the body", "rad s-1"),
    "omega_max": Variable("greatest angular velocity of the body", "rad s-1"),
    "reversals": Variable("reversals of the motion", dtype="int32"),
    "turns": Variable("full turns since the last reversal or the start", dtype="int32"),
    "stick_time": Variable("time for which the body sticks to the ring", "s"),
    "normal_min_1": Variable("least normal reaction at contact 1", "N"),
    "normal_min_2": Variable("least normal reaction at contact 2", "N"),
    "x_end": Variable("displacement of the body at the end", "m"),
    "velocity_end": Variable("velocity of the body at the end", "m s-1"),
    "x_min": Variable("least displacement of the body", "m"),
    "x_max": Variable("greatest displacement of the body", "m"),
    "velocity_max": Variable("greatest velocity of the body", "m s-1"),
    "slips": Variable("slips that follow a stick", dtype="int32"),
    "first_slip": Variable("time at which the first slip begins", "s"),
    "period": Variable("mean period of the complete cycles after the first", "s"),
    "force_max": Variable("greatest magnitude of the friction force", "N"),
    "steps": Variable("steps of the integration", dtype="int64"),
    "stiffness": Variable("largest stiffness met: magnitude of the eigenvalue times the step"),
    "certified": Variable(
        "whether two resolutions agree on regime, motion and separating contact, and the run obeys its law",
        dtype="int8",
        flags={0: "not_certified", 1: "certified"},
    ),
}

# Bounds on errors, of which two digits are enough.
OUTCOMES |= {
    f"{name}_error": replace(
        OUTCOMES[name], long_name=f"bound on the error: {OUTCOMES[name].long_name}", dtype="float32"
    )
    for name in (
        *("t_separation", "t_end", "phi_end", "omega_end", "phi_min", "phi_max", "omega_min", "omega_max"),
        *("x_end", "velocity_end", "x_min", "x_max", "velocity_max", "period"),
    )
}


def linked(name: str, columns: Collection[str]) -> dict[str, str]:
    """CF attribute that leads from a quantity to the bound on its error, if that is among the columns of a dataset."""
    error = f"{name}_error"
    return {"ancillary_variables": error} if error in columns else {}


HISTORY: dict[str, Variable] = {
    "phi": Variable("angle of the body", "rad"),
    "omega": Variable("angular velocity of the body", "rad s-1"),
    "epsilon": Variable("angular acceleration of the body", "rad s-2"),
    "normal_1": Variable("normal reaction at contact 1", "N"),
    "normal_2": Variable("normal reaction at contact 2", "N"),
    "ring_omega": Variable("angular velocity of the ring", "rad s-1"),
    "theta": Variable("angle of the ring", "rad"),
    "zone_1": Variable("segment of the ring under contact 1", dtype="int32"),
    "zone_2": Variable("segment of the ring under contact 2", dtype="int32"),
    "x": Variable("displacement of the body", "m"),
    "velocity": Variable("velocity of the body", "m s-1"),
    "friction_force": Variable("friction force", "N"),
    "deflection": Variable("deflection of the bristles", "m"),
    "deflection_1": Variable("deflection of the bristles at contact 1", "m"),
    "deflection_2": Variable("deflection of the bristles at contact 2", "m"),
    "mode": Variable("friction mode", dtype="int8", flags=MODES),
}

#: Of what `ringsweep.runs.precision` measures; a length stands in for the angle where the body moves along a line.
PRECISION: dict[str, Variable] = {
    "time_per_run": Variable("time per run in one thread", "s"),
    "steps": Variable("steps of the integration, mean over the cells"),
    "error_end": Variable("error of the angle of the body at the end", "rad"),
    "error_separation": Variable("error of the time of separation, where both separate", "s"),
    "regime_wrong": Variable(
        "whether regime, motion or separating contact differ from those of the reference",
        dtype="int8",
        flags={0: "right", 1: "wrong"},
    ),
    "flagged": Variable(
        "whether the certificate of this setting does not pass the answer: not certified, or replaced by a finer run's",
        dtype="int8",
        flags={0: "passed", 1: "flagged"},
    ),
    "reference_error_end": Variable("difference of the two tightest runs in the angle of the body at the end", "rad"),
    "reference_error_separation": Variable("difference of the two tightest runs in the time of separation", "s"),
}


def words(data: xr.DataArray) -> xr.DataArray:
    """The names that the flags of a classification stand for.

    Parameters
    ----------
    data : xarray.DataArray
        A classification as datasets have it, ``regime`` or ``certified`` say, or a part of one.

    Returns
    -------
    xarray.DataArray
        Text of the same shape; empty where a value is none of the flags.

    Raises
    ------
    InputError
        If it is not a classification.

    Examples
    --------
    >>> import ringsweep
    >>> from ringsweep.config import load
    >>> scene = load("my-sweep.yaml").source["scene"]
    >>> maps = ringsweep.sweep(scene, {"drive.amplitude": [0.1, 2.0]})
    >>> ringsweep.words(maps.regime).values.tolist()
    ['oscillatory', 'separating']
    """
    import numpy as np

    if not {"flag_values", "flag_meanings"} <= data.attrs.keys():
        raise InputError(str(data.name), "is not a classification: it has no flag_values and flag_meanings")
    meanings = dict(zip(np.atleast_1d(data.attrs["flag_values"]), data.attrs["flag_meanings"].split(), strict=True))
    named = np.full(data.shape, "", dtype=f"<U{max(map(len, meanings.values()))}")
    for value, meaning in meanings.items():
        named[data.values == value] = meaning
    kept = {name: text for name, text in data.attrs.items() if not name.startswith("flag_")}
    found = data.copy(data=named)
    found.attrs = kept
    return found
