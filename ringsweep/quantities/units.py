"""Numbers of a configuration: a plain number is SI, a string or a quantity of pint may have a unit."""

from __future__ import annotations

import contextlib
import math
import re
import reprlib
from functools import cache, lru_cache
from numbers import Real
from pathlib import Path
from typing import Any

from ringsweep.errors import InputError, shortened
from ringsweep.quantities.parameters import Parameter
from ringsweep.quantities.quantity import after_number, cf_units

NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")

_DECIMAL_COMMA = re.compile(r"[-+]?[0-9]*,[0-9][^,]*")
_NOT_FINITE = re.compile(r"[-+]?\.?(nan|inf|infinity)", re.IGNORECASE)
_WORD = r"[A-Za-zµμ°%_]+(?:(?:\^|\*\*)?-?[0-9])?"
_UNIT = re.compile(rf"(?:1\s*/\s*)?{_WORD}(?:(?:\s*[*/·]\s*|\s+){_WORD})*")

# Longest text, in characters, that can be a number with a unit.
_LONGEST = 100

# Simple multiples of pi, as messages write them.
_OF_PI = {0.5: "pi/2", 1.0: "pi", 2.0: "2 pi"}

#: Integers from here on are no values of a configuration.
LONG_INTEGER = 10**_LONGEST


def quantity(value: Any, parameter: Parameter, path: str) -> float:
    """A value of a configuration, in the unit of its parameter.

    Parameters
    ----------
    value : object
        A plain number (SI), a string with a number and possibly a unit, or a quantity of pint.
    parameter : Parameter
        Gives the unit and the allowed values.
    path : str
        Path of the value in the configuration, for messages.

    Raises
    ------
    InputError
        If `value` is not a finite number, has a wrong unit, lies outside the interval of the parameter, or is not whole
        although the parameter is.
    """
    value = spelled(value)
    number = _convert(value, parameter, path)
    if parameter.allows(number):
        if parameter.whole and not number.is_integer():
            raise InputError(path, f"{show(value)} is not a whole number: {parameter.long_name} must be one")
        return number
    unit = after_number(parameter.unit)
    plain = not isinstance(value, str) or is_plain(value)
    if plain and parameter.unit == "rad" and abs(number) > parameter.upper > 0.0:
        end = _OF_PI.get(parameter.upper / math.pi, f"{parameter.upper:g}")
        raise InputError(path, f"{number:g} rad is beyond {end}: was `{number:g} deg` meant?")
    shown = f"{number:g}{unit}" if plain else f"{show(value)} ({number:g}{unit})"
    raise InputError(path, f"{shown} is not allowed: {parameter.long_name} must be {parameter.interval}{unit}")


def check_unit(unit: str, parameter: Parameter, path: str) -> None:
    """Refuse a unit in which a number cannot be given."""
    try:
        _convert(f"1 {unit}", parameter, path)
    except InputError:
        fits = f"is in {parameter.unit}" if parameter.unit not in ("", "1") else "has no unit"
        raise InputError(path, f"the unit {unit!r} does not fit: {parameter.long_name} {fits}") from None


def is_quantity(value: Any) -> bool:
    """Whether a value is a quantity of pint, from whatever registry."""
    return all(hasattr(value, name) for name in ("magnitude", "units", "to_root_units"))


def spelled(value: Any) -> Any:
    """A quantity of pint as text with its unit, such as ``"20 rpm"``; an array of them as nested lists of texts.

    Any other value is returned as it is. The text keeps the difference between Hz and rad/s, which the registries of
    pint do not know.
    """
    if not is_quantity(value):
        return value
    unit = f"{value.units:C}"
    # A ValueError means another dimension.
    with contextlib.suppress(ValueError):
        try:
            _factor(unit, "1")
        except LookupError:
            # Units that are not known here, such as pounds-force, have roots that are: gram, meter, second, radian.
            # Logarithmic units may have none, and huge integers no conversion: both are refused later.
            with contextlib.suppress(_pint().PintError, OverflowError):
                value = value.to_root_units()
                unit = f"{value.units:C}"
    magnitude = value.magnitude

    def text(number: Any) -> Any:
        return [text(part) for part in number] if isinstance(number, list) else f"{number} {unit or 'dimensionless'}"

    return text(magnitude.tolist() if hasattr(magnitude, "tolist") else magnitude)


def percent_at_most(share: float) -> str:
    """An upper bound on a share, in per cent with two digits, rounded up.

    >>> percent_at_most(0.0050159), percent_at_most(0.25), percent_at_most(0.0)
    ('0.51 %', '25 %', '0 %')
    """
    return f"{100 * rounded_up(share):.3g} %"


def rounded_up(number: float) -> float:
    """A number that is not negative with two digits, rounded up. The errors of its last bits are no reason to do so.

    >>> rounded_up(201.0), rounded_up(200.0), rounded_up(0.0)
    (210.0, 200.0, 0.0)
    """
    unit = 10.0 ** (math.floor(math.log10(number)) - 1) if number > 0.0 else 1.0
    return math.ceil(number / unit - 1e-9) * unit


def is_plain(value: Any) -> bool:
    """Whether a value is a number without a unit, as a number or as text."""
    if isinstance(value, str):
        return bool(NUMBER.fullmatch(value.strip()))
    return isinstance(value, Real) and not isinstance(value, bool)


def other_unit(value: Any, parameter: Parameter) -> str:
    """The unit of a text such as ``"60 deg"``; empty if it has none, or if its number is the same in SI units.

    >>> angle = Parameter("rad", "angle")
    >>> other_unit("60 deg", angle), other_unit("1 rad", angle), other_unit(60.0, angle)
    ('deg', '', '')
    """
    text = value.strip() if isinstance(value, str) and len(value) <= _LONGEST else ""
    match = NUMBER.match(text)
    unit = text[match.end() :].strip() if match else ""
    with contextlib.suppress(LookupError, ValueError):
        return unit if unit and parameter.unit and _factor(unit, parameter.unit) != 1.0 else ""
    return ""


class _Quotes(reprlib.Repr):
    """Short texts of values: of a long text the start and the length."""

    def repr_str(self, value: str, level: int) -> str:
        return repr(value) if len(value) <= 60 else f"{value[:40]!r}... ({len(value)} characters)"

    def repr_int(self, value: int, level: int) -> str:
        # Python refuses to write an integer of thousands of digits.
        return repr(value) if abs(value) < LONG_INTEGER else f"an integer of more than {_LONGEST} digits"


_QUOTES = _Quotes()
_QUOTES.maxlevel = 2


def show(value: Any) -> str:
    """A value as messages quote it: one short line."""
    return "nothing" if value is None else shortened(_QUOTES.repr(value), 300)


def _convert(value: Any, parameter: Parameter, path: str) -> float:
    """A finite number in the parameter's unit."""
    wanted = f"{parameter.long_name} is a number" + (f" in {parameter.unit}" if parameter.unit not in ("", "1") else "")
    unit = None
    if isinstance(value, str):
        text = value.strip()
        if len(text) <= _LONGEST and _DECIMAL_COMMA.fullmatch(text):
            raise InputError(path, f"{show(value)}: write a decimal point, not a comma; {wanted}")
        match = NUMBER.match(text) if len(text) <= _LONGEST else None
        if match is None and not _NOT_FINITE.fullmatch(text):
            raise InputError(path, f"{show(value)} is not a number: {wanted}")
        number = float(match.group()) if match else math.nan
        unit = text[match.end() :].strip() if match else None
    elif isinstance(value, Real) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
    else:
        raise InputError(path, f"{show(value)} is not a number: {wanted}")
    if unit:
        number *= _factor_or_error(unit, value, parameter, path)
    if not math.isfinite(number):
        raise InputError(path, f"{show(value)} is not finite: {wanted}")
    return number


def _factor_or_error(unit: str, value: str, parameter: Parameter, path: str) -> float:
    if not parameter.unit:
        its = f": its unit is {parameter.unit_in_words}" if parameter.unit_in_words else ""
        problem = f"{show(value)} has a unit, but {parameter.long_name} takes a plain number in SI units{its}"
        raise InputError(path, problem)
    target = "has no unit" if parameter.unit == "1" else f"is in {parameter.unit}"
    try:
        return _factor(unit, parameter.unit)
    except _pint().PintError:
        problem = f"{parameter.long_name} is declared in {parameter.unit!r}, no known unit"
    except LookupError:
        problem = f"{show(value)}: {show(unit)} is not a known unit; {parameter.long_name} {target}"
    except ValueError:
        problem = f"{show(value)} has the wrong unit: {parameter.long_name} {target}{_hint(unit, parameter.unit)}"
    raise InputError(path, problem)


#: What a unit of another dimension may have meant: unit that is wanted, one that was given, and the advice.
_MEANT = (
    ("rad", "m", "the angle of an arc is its length divided by the radius"),
    ("rad", "rad/s", "an angle is wanted, not its rate; the drive `constant` takes a rate"),
    ("Hz", "rad/s", "a frequency counts cycles: 60 rpm, or 2 pi rad/s, is 1 Hz"),
)


def _hint(given: str, wanted: str) -> str:
    """End of the message about a unit of another dimension."""
    for target, source, advice in _MEANT:
        with contextlib.suppress(LookupError, ValueError):
            if wanted == target and _factor(given, source):
                return f": {advice}"
    return ""


@lru_cache(maxsize=256)
def _factor(unit: str, target: str) -> float:
    """Factor from `unit` to `target`; LookupError if `unit` is unknown, ValueError if it has another dimension."""
    if unit == target:
        return 1.0
    if not _UNIT.fullmatch(unit):
        raise LookupError
    if cf_units(unit) == cf_units(target):
        return 1.0
    registry = _registry()
    try:
        source = registry.Quantity(1.0, _parsed(unit))
    except (_pint().PintError, ValueError):
        raise LookupError from None
    if not source.is_compatible_with(_parsed(target)):
        raise ValueError
    return float(source.to(_parsed(target)).magnitude)


def _parsed(unit: str) -> Any:
    # Pint wants "^" before a power, which CF leaves out: "rad s-1".
    powers = re.sub(r"(?<=[A-Za-zµμ°%_])(-?[0-9])", r"^\1", unit)
    return _registry().parse_units("" if powers == "1" else powers)


def _pint() -> Any:
    # Importing pint takes longer than a small sweep, and many configurations have no unit to convert.
    import pint

    return pint


@cache
def _registry() -> Any:
    return _pint().UnitRegistry(Path(__file__).with_name("units.txt").read_text(encoding="utf-8").splitlines())
