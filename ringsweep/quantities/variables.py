"""Variables of every dataset: name, type, unit, meaning and flags, each declared once."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ringsweep.errors import InputError
from ringsweep.quantities.flags import AFTERMATHS, JAMMED, LONG_RUNS, REGIMES, SEPARATING
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.quantity import Quantity
from ringsweep.quantities.units import NUMBER, quantity

if TYPE_CHECKING:
    import xarray as xr

#: What each regime says, of the ring or of the belt.
DEFINITIONS = {
    "resting": "neither a reversal nor a full turn",
    "oscillatory": "ring: at least one reversal, and less than a full turn since the last; "
    "belt: slips at all times, and its amplitude does not decay",
    "revolving": "a full turn since the last reversal or the start",
    "separating": "a normal reaction reached zero",
    "jammed": "rigid-body dynamics had no solution, or more than one",
    "failed": "a number was not finite, or the limit of the work was reached",
    "stick-slip": "sticks and slips by turns",
    "sliding": "keeps to steady slip, or settles to it",
    "sticking": "came to stick for good",
    "riding": "has stuck since the launch",
}

#: Origin of a cell of a refined sweep. An audited cell was inferred, and then run.
COMPUTED, INFERRED, AUDITED = range(3)

#: Why a cell has no certificate, in the order of the flag values, and what each reason says.
DOUBTS = {
    "none": "the cell is certified",
    "not_asked": "certify is false",
    "failed": "the run failed, or its repetition at a tighter tolerance",
    "answers_differ": "two resolutions differ in regime, motion or separating contact",
    "law_not_obeyed": "the run does not obey its law or its balance of energy, or an impact gains energy",
    "close_call": "the regime depends on less than the error of the run",
    "not_finite": "a number is not finite",
    "same_steps": "both resolutions took the same steps, so that their agreement says nothing",
    "diverging": "nearby runs diverge, and have no common statistics",
    "step_too_long": "rk4: the step exceeds the limit of stability, or leaps over a zone or over a contact that opens",
}

MODES = {-1: "slip_backward", 0: "stick", 1: "slip_forward"}


@dataclass(frozen=True)
class Variable(Quantity):
    """One variable of a dataset.

    Attributes
    ----------
    unit, long_name : str
        As for :class:`ringsweep.quantities.quantity.Quantity`.
    dtype : str
        NumPy type in files.
    flags : dict of int to str, optional
        Values of a classification, and their meanings.
    comment : str
        What the meanings are, if their names do not tell.
    dims : tuple of str
        Dimensions besides those of the grid.
    """

    dtype: str = "float64"
    flags: dict[int, str] | None = None
    comment: str = ""
    dims: tuple[str, ...] = ()

    @property
    def attributes(self) -> dict[str, Any]:
        """CF attributes."""
        attributes = super().attributes
        if self.comment:
            attributes["comment"] = self.comment
        if self.flags:
            attributes["flag_values"] = np.array(list(self.flags), dtype=self.dtype)
            attributes["flag_meanings"] = " ".join(meaning.replace(" ", "_") for meaning in self.flags.values())
        return attributes


def classes(long_name: str, meanings: Mapping[int, str] | Collection[str], comment: str = "") -> Variable:
    """A classification; flags of meanings that are given without them count from 0."""
    flags = dict(meanings if isinstance(meanings, Mapping) else enumerate(meanings))
    return Variable("1", long_name, dtype="int8", flags=flags, comment=comment)


def explained(meanings: Mapping[str, str], names: Collection[str] | None = None) -> str:
    """Names, or some of them, and what each says, as one text."""
    return "; ".join(f"{name}: {meanings[name]}" for name in names or meanings)


_MOTIONS = {flag: name for flag, name in enumerate(REGIMES) if flag not in (SEPARATING, JAMMED)}
_STATEMENT = "a statement about the span of the run, not about all times; "
#: Contacts in the order of their flag values.
CONTACTS = ("none", "contact_1", "contact_2", "both")


HISTORY: dict[str, Variable] = {
    "phi": Variable("rad", "angle of the body"),
    "omega": Variable("rad/s", "angular velocity of the body"),
    "epsilon": Variable("rad/s^2", "angular acceleration of the body"),
    "normal_1": Variable("N", "normal reaction at contact 1"),
    "normal_2": Variable("N", "normal reaction at contact 2"),
    "ring_omega": Variable("rad/s", "angular velocity of the ring"),
    "theta": Variable("rad", "angle of the ring"),
    "zone_1": Variable("1", "segment of the ring under contact 1", dtype="int32"),
    "zone_2": Variable("1", "segment of the ring under contact 2", dtype="int32"),
    "x": Variable("m", "displacement of the body"),
    "velocity": Variable("m/s", "velocity of the body"),
    "belt_x": Variable("m", "displacement of the belt"),
    "belt_velocity": Variable("m/s", "velocity of the belt"),
    "friction_force": Variable("N", "friction force"),
    "force": Variable("N", "applied force on the body"),
    "load": Variable("N", "applied normal load on the body, beside its weight"),
    "deflection": Variable("m", "deflection of the bristles"),
    "contact_age": Variable("s", "age of the contacts"),
    "deflection_1": Variable("m", "deflection of the bristles at contact 1"),
    "deflection_2": Variable("m", "deflection of the bristles at contact 2"),
    "mode": classes("friction mode", MODES),
    "y": Variable("m", "height of the centre of mass above the axis"),
    "gap_1": Variable("m", "gap of contact 1"),
    "gap_2": Variable("m", "gap of contact 2"),
}

OUTCOMES: dict[str, Variable] = {
    "regime": classes("regime of the run", REGIMES, _STATEMENT + explained(DEFINITIONS)),
    "motion": classes(
        "motion up to the end of the run", _MOTIONS, _STATEMENT + explained(DEFINITIONS, _MOTIONS.values())
    ),
    "separating_contact": classes("contact that separates", CONTACTS),
    "t_separation": Variable("s", "time of separation"),
    "t_end": Variable("s", "time at which the run ends"),
    "reversals": Variable("1", "reversals of the motion", dtype="int32"),
    "turns": Variable("1", "full turns since the last reversal or the start", dtype="int32"),
    "stick_time": Variable("s", "time for which the body sticks to the ring or belt"),
    "started_from": classes(
        "state from which the run started",
        ("initial", "end_of_the_cell_before"),
        "a chain starts from `initial`, and again after a run that failed or ended before its span",
    ),
    "slips": Variable("1", "slips that follow a stick", dtype="int32"),
    "first_slip": Variable("s", "time at which the first slip begins"),
    "period": Variable("s", "time in which the motion returns"),
    "stick_share": Variable("1", "share of a cycle in which the body sticks to the belt"),
    "stops_per_cycle": Variable("1", "stops in a cycle"),
    "swing": Variable("m", "distance between the extremes of the displacement in the last cycle"),
    "drift": Variable(
        "m/s", "mean velocity of the body in the last cycles, or without them in the second half of the span"
    ),
    "settled": classes("whether the motion has settled", ("not_settled", "settled")),
    "long_run": classes(
        "what the motion settles to",
        LONG_RUNS,
        "rest: at rest; steady: steady slip; periodic: returns each time; quasi-periodic: does not return, and "
        "the exponent is zero; chaotic: does not return, and the exponent is positive; unbounded: the swing grows "
        "steadily beyond all scales of the scene; transient: not settled, or nothing shows that it has",
    ),
    "force_max": Variable("N", "greatest magnitude of the friction force"),
    "jump_max": Variable("rad/s^2", "largest jump of the angular acceleration of the body"),
    "t_jump_max": Variable("s", "time of the largest jump of the acceleration"),
    "lyapunov": Variable("1/s", "largest Lyapunov exponent; of a free periodic motion without that along the motion"),
    "lyapunov_error": Variable("1/s", "standard error of the largest Lyapunov exponent"),
    "multiplier_1": Variable("1", "largest magnitude of the Floquet multipliers of the periodic motion"),
    "multiplier_2": Variable("1", "second largest magnitude of the Floquet multipliers of the periodic motion"),
    "multiplier_angle_1": Variable("rad", "argument of the largest Floquet multiplier of the periodic motion"),
    "multiplier_angle_2": Variable("rad", "argument of the second largest Floquet multiplier of the periodic motion"),
    "open_time": Variable("s", "time for which a contact is open"),
    "flight_time": Variable("s", "time for which no contact holds"),
    "gap_max": Variable("m", "greatest gap of a contact"),
    "separations": Variable("1", "losses of contacts", dtype="int32"),
    "impacts": Variable("1", "impacts; the last rebounds of a contact that comes to rest are one", dtype="int32"),
    "impact_speed_max": Variable("m/s", "greatest normal velocity before an impact"),
    "impulse_max": Variable("N s", "greatest normal impulse of an impact"),
    "impact_loss": Variable("J", "energy lost in impacts, relative to the moving ring"),
    "tumbles": Variable("1", "changes of the order of the contacts", dtype="int32"),
    "t_recovered": Variable("s", "time from which both contacts hold again"),
    "aftermath": classes(
        "what follows a lost contact",
        AFTERMATHS,
        "held: no contact was lost; recovered: all contacts hold at the end, in their first order; open: a "
        "contact is open at the end; tumbled: the contacts have touched in the other order",
    ),
    "steps": Variable("1", "steps of the integration", dtype="int64"),
    "stiffness": Variable("1", "largest stiffness met: magnitude of the eigenvalue times the step"),
    "certified": classes(
        "whether two resolutions agree on regime, motion and separating contact, and the run obeys its law",
        ("not_certified", "certified"),
    ),
    "uncertified_because": classes("why the cell is not certified", DOUBTS.keys(), explained(DOUBTS)),
    "origin": classes(
        "whether the cell was run, or inferred from its neighbours",
        {COMPUTED: "computed", INFERRED: "inferred", AUDITED: "audited"},
    ),
    "level": Variable("1", "halvings of the blocks of the map around the cell", dtype="int8"),
}

# Ends and extremes of what histories show.
for _part, _what, _shown in (
    ("end", "{} at the end", ("phi", "omega", "x", "velocity", "deflection", "contact_age")),
    ("min", "least {}", ("phi", "omega", "x", "normal_1", "normal_2")),
    ("max", "greatest {}", ("phi", "omega", "x", "velocity", "normal_1", "normal_2")),
):
    for _name in _shown:
        _long = _what.format(HISTORY[_name].long_name)
        OUTCOMES[re.sub(r"(_[12])?$", rf"_{_part}\1", _name, count=1)] = replace(HISTORY[_name], long_name=_long)

#: Masses of a pair on a belt. The numbers of mass 1 are those of a belt, with ``_1`` after their names.
MASSES = (1, 2)

_ON_BELT = (
    *("motion", "x_end", "velocity_end", "x_min", "x_max", "velocity_max", "stick_time", "slips", "first_slip"),
    *("period", "stick_share", "stops_per_cycle", "swing", "drift", "long_run", "force_max", "jump_max", "t_jump_max"),
)
for _i in MASSES:
    for _table, _names in ((HISTORY, ("x", "velocity", "friction_force", "mode")), (OUTCOMES, _ON_BELT)):
        for _name in _names:
            _table[f"{_name}_{_i}"] = replace(_table[_name], long_name=f"{_table[_name].long_name}, of mass {_i}")

#: Outcomes that are the points of a section, place and velocity first.
POINTS = tuple(
    f"{name}_section"
    for name in ("x", "velocity", "deflection", "contact_age", "phi", "omega", "deflection_1", "deflection_2")
)

for _point in POINTS:
    _of = HISTORY[_point.removesuffix("_section")]
    _where = ", from -pi to pi, at" if _point == "phi_section" else " at"
    _name = f"{_of.long_name}{_where} the points of its section"
    OUTCOMES[_point] = replace(_of, long_name=_name, dims=("section",))

#: Classifications that a refined sweep infers.
LABELS = ("regime", "motion", "separating_contact", "aftermath")

#: Value in files where a whole number is missing, because its cell is inferred.
MISSING = -1

# Outcomes that have a bound on their error.
_BOUNDED = (
    *("t_separation", "t_end", "phi_end", "omega_end", "phi_min", "phi_max", "omega_min", "omega_max"),
    *("x_end", "velocity_end", "x_min", "x_max", "velocity_max", "period"),
    *("open_time", "flight_time", "gap_max", "impact_speed_max", "impulse_max", "impact_loss", "t_recovered"),
    *("normal_min_1", "normal_min_2", "normal_max_1", "normal_max_2", "force_max", "jump_max"),
)

for _name in (*_BOUNDED, *(f"{name}_{i}" for i in MASSES for name in _ON_BELT if name in _BOUNDED)):
    _long = f"bound on the error: {OUTCOMES[_name].long_name}"
    # Two digits are enough.
    OUTCOMES[f"{_name}_error"] = replace(OUTCOMES[_name], long_name=_long, dtype="float32")


def error_attribute(name: str, columns: Collection[str]) -> dict[str, str]:
    """CF attribute that links a variable to the bound on its error, if the dataset has that column."""
    error = f"{name}_error"
    return {"ancillary_variables": error} if error in columns else {}


_INDEX = "Sobol index of the indicator of each regime"

#: Variables of each cell of a sampled sweep.
SAMPLED: dict[str, Variable] = {
    "probability": Variable("1", "probability of each regime", comment=_STATEMENT + explained(DEFINITIONS)),
    "probability_numerics": Variable("1", "part of the length of the interval that runs without certificate add"),
    "runs": Variable("1", "runs of each replicate, without and with certificate", dtype="int32"),
    "survival": Variable("1", "probability that a contact still holds, or that a body still rides"),
    "sobol_first": Variable("1", f"first {_INDEX}"),
    "sobol_total": Variable("1", f"total {_INDEX}"),
}
SAMPLED |= {
    f"{name}_{end}": Variable("1", f"{side} end of the 95 % interval: {SAMPLED[name].long_name}")
    for name in ("probability", "survival", "sobol_first", "sobol_total")
    for end, side in (("low", "lower"), ("high", "upper"))
}

#: What a quantile, and the ends of its 95 % interval, are called, by the end of the name of their variable.
QUANTILE_ENDS = {"": "quantile", "_low": "lower end of a quantile", "_high": "upper end of a quantile"}

#: What happens to the contacts in an event, by its number in histories.
EVENTS = {1: "separation", 2: "rebound", 3: "closure"}

#: Impacts of a run, along the dimension ``impact``.
IMPACTS: dict[str, Variable] = {
    "impact_time": Variable("s", "time of the impact"),
    "impact_contact": classes("contact of the impact", {1: "contact_1", 2: "contact_2", 3: "both"}),
    "impact_speed": Variable("m/s", "normal velocity before the impact"),
    "impulse": Variable("N s", "greatest normal impulse"),
}

#: Variables of :func:`ringsweep.precision`. For a belt a displacement replaces the angle.
PRECISION: dict[str, Variable] = {
    "time_per_run": Variable("s", "time per run in one thread"),
    "steps": Variable("1", "steps of the integration, mean over the cells"),
    "error_end": Variable("rad", "error of the angle of the body at the end"),
    "error_separation": Variable("s", "error of the time of separation, where both separate"),
    "regime_wrong": classes(
        "whether regime, motion or separating contact differ from those of the reference", ("right", "wrong")
    ),
    "flagged": classes(
        "whether the certificate of this setting does not pass the answer: not certified, or replaced by a finer run's",
        ("passed", "flagged"),
    ),
    "reference_error_end": Variable("rad", "difference of the two tightest runs in the angle of the body at the end"),
    "reference_error_separation": Variable("s", "difference of the two tightest runs in the time of separation"),
}


def is_classification(data: xr.DataArray | xr.Variable) -> bool:
    """Whether the values of a variable are flags."""
    return {"flag_values", "flag_meanings"} <= data.attrs.keys()


def meanings_of(data: xr.DataArray | xr.Variable) -> dict[int, str]:
    """Flags of a classification with their meanings, each one word.

    Raises
    ------
    KeyError, ValueError
        If it has no flags, or not as many as meanings.
    """
    flags = np.atleast_1d(data.attrs["flag_values"]).tolist()
    return dict(zip(flags, data.attrs["flag_meanings"].split(), strict=True))


def check_flags(data: xr.DataArray) -> None:
    """Refuse a classification whose values lie between flags.

    Raises
    ------
    InputError
        If a value is a number, but not a whole one, as a mean of flags is.
    """
    values = data.values.astype(float)
    if (np.isfinite(values) & (values != np.round(values))).any():
        over = f"(ds.ringsweep.words({str(data.name)!r}) == 'WORD').mean(...)"
        raise InputError(str(data.name), f"has values between flags, as a mean has: the share of a word is {over}")


def words(data: xr.DataArray) -> xr.DataArray:
    """Names in place of the flags of a classification.

    Parameters
    ----------
    data : xarray.DataArray
        A classification of a dataset, such as ``regime`` or ``certified``, or a selection from it.

    Returns
    -------
    xarray.DataArray
        Text of the same shape; empty where a value is none of the flags. It has no attributes: xarray would hand the
        ``long_name`` on to a comparison such as ``words(ds.regime) == "separating"``, which is no regime.

    Raises
    ------
    InputError
        If `data` is not a classification.

    Examples
    --------
    >>> import ringsweep
    >>> from ringsweep.config import load
    >>> scene = load("my-sweep.yaml").source["scene"]
    >>> maps = ringsweep.sweep(scene, {"drive.amplitude": [0.1, 2.0]})
    >>> ringsweep.words(maps.regime).values.tolist()
    ['oscillatory', 'separating']
    """
    if not is_classification(data):
        # A whole dataset has no name.
        name = str(getattr(data, "name", "data"))
        raise InputError(name, "is not a classification, such as ds.regime: it has no flag_values and flag_meanings")
    check_flags(data)
    meanings = meanings_of(data)
    text = np.full(data.shape, "", dtype=f"<U{max(map(len, meanings.values()))}")
    for value, meaning in meanings.items():
        text[data.values == value] = meaning
    found = data.copy(data=text)
    found.attrs = {}
    return found


def swept(ds: xr.Dataset) -> list[xr.DataArray]:
    """Coordinates that stand for paths of the configuration."""
    return [coordinate for coordinate in ds.coords.values() if "path" in coordinate.attrs]


def configuration_of(ds: xr.Dataset) -> dict[str, Any]:
    """The configuration that a dataset was made from.

    Raises
    ------
    InputError
        If the dataset has no attribute ``configuration``.
    """
    if "configuration" not in ds.attrs:
        raise InputError("ds", "has no attribute configuration, so its scene is not known")
    return dict(json.loads(ds.attrs["configuration"]))


def written(configuration: Mapping[str, Any], path: str) -> Any:
    """What a configuration says at a path of its scene; None if it says nothing there."""
    node: Any = configuration.get("scene")
    for key in path.split("."):
        node = node.get(key) if isinstance(node, Mapping) else None
    return node


def written_values(configuration: Mapping[str, Any], path: str) -> list[Any]:
    """Numbers as a configuration writes them: those of an axis if they have units, or else that in the scene."""
    axes: dict[str, Any] = {}
    for columns in ((configuration.get("sweep") or {}).get(key) or {} for key in ("points", "grid")):
        axes |= {name.strip(): given for names, given in columns.items() for name in names.split(",")}
    on_axis = leaves(axes.get(path))
    return on_axis if any(isinstance(value, str) for value in on_axis) else leaves(written(configuration, path))


def written_unit(configuration: Mapping[str, Any], path: str) -> str:
    """The unit in which a configuration writes a number; empty if it writes plain ones, or several units."""
    return common_unit(written_values(configuration, path))


def common_unit(values: Iterable[Any]) -> str:
    """The unit that follows the number in all texts among some values; empty if it is not one."""
    texts = [value.strip() for value in values if isinstance(value, str)]
    units = {text[match.end() :].strip() for text in texts if (match := NUMBER.match(text))}
    return units.pop() if len(units) == 1 else ""


def leaves(value: Any) -> list[Any]:
    """All values within a value of a configuration."""
    if not isinstance(value, Mapping | list):
        return [value]
    return [leaf for part in (value.values() if isinstance(value, Mapping) else value) for leaf in leaves(part)]


def in_unit(data: xr.DataArray, unit: str) -> xr.DataArray:
    """Numbers in another unit than SI; as they are if it is empty.

    Raises
    ------
    InputError
        If the unit does not fit.
    """
    if not unit:
        return data
    si = Parameter(str(data.attrs.get("units", "1")), str(data.attrs.get("long_name", data.name)))
    return (data / quantity(f"1 {unit}", si, "unit")).assign_attrs(data.attrs | {"units": unit})
