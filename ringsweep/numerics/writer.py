"""Source code of expressions: for floats, for vector lanes, and for power series.

Expressions are those of :mod:`ringsweep.numerics.expressions`. Each function returns the lines of a function body. A
parameter has the source text that `names` gives it; the variable is called ``speed``. The time is the sum of ``now``
and ``rest``, see :mod:`ringsweep.numerics.clock`; sines and cosines of it call ``phase``.

In kernels an interval of the speed is known where a series is computed. There a switch is an ``if``, and only one side
of it is computed. In vector lanes each lane may be on another side, so both sides are computed, except where no lane
needs a side that calls functions.

`writer` collects the lines; ``writer.known`` maps each node that is computed already to its name in the source.
`side` and `threshold` are source texts with a place for the index of a threshold. Laws and drives call the public
functions when their type is made.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, partial

from ringsweep.numerics.expressions import (
    FUNCTIONS,
    TIME,
    ZERO,
    Node,
    derivative,
    frequency,
    multiply,
    nodes_of,
    number,
    quotient_of,
)

_FUNCTIONS = {*FUNCTIONS, "power"}

_OPERATORS = {"add": "+", "multiply": "*", "divide": "/"}


@dataclass
class _Writer:
    """Lines of source code, and the names of the nodes that are computed so far."""

    names: Mapping[str, str]
    lines: list[str] = field(default_factory=list)
    indent: str = ""
    known: dict[Node, str] = field(default_factory=dict)
    count: int = 0
    free: int = 0

    def write(self, line: str) -> None:
        """Append a line."""
        self.lines.append(self.indent + line)

    def new(self, text: str) -> str:
        """Append the definition of a new name, and return the name."""
        self.count += 1
        self.write(f"n{self.count} = {text}")
        return f"n{self.count}"

    @contextmanager
    def block(self, head: str) -> Iterator[None]:
        """Lines that only run under a condition; what they compute is unknown afterwards."""
        known, indent = dict(self.known), self.indent
        self.write(head)
        self.indent += "    "
        yield
        self.known, self.indent = known, indent

    def constants(self, *outputs: Node) -> None:
        """Compute all nodes that do not depend on the speed."""
        for node in nodes_of(*outputs):
            if not node.varies and node not in self.known:
                self.known[node] = self.value(node)

    def value(self, node: Node) -> str:
        """Name of a node whose parts are known, computed now; not of a switch."""
        if node.kind == "number":
            return repr(node.value) if node.value == node.value else "nan"
        if node.kind == "symbol":
            return self.names[node.value]
        if node.kind == "variable":
            return "now" if node is TIME else str(node.value)
        if node.kind == "held":
            return f"drive.held[{node.value}]"
        if node.kind in ("sin", "cos") and (turning := frequency(node.parts[0])) is not None:
            _straight(self, list(turning))
            turns, shift, start = (self.known[part] for part in turning)
            phase = f"phase({turns}, now, rest, {start})"
            if turning[1] is not ZERO:
                phase = f"shifted_phase({turns}, now, rest, {shift}, {start})"
            return self.new(f"{node.kind}_of({phase})")
        parts = [self.known[part] for part in node.parts]
        if node.kind in _OPERATORS:
            text = f" {_OPERATORS[node.kind]} ".join(parts)
            if TIME in node.parts and not (slope := derivative(node)).varies:
                # In a sum or multiple of the time its rest is not lost.
                _straight(self, [slope])
                text += f" + {self.known[slope]} * rest"
            return self.new(text)
        if node.kind in ("minimum", "maximum"):
            return self.new(f"{node.kind[:3]}({', '.join(parts)})")
        return self.new(f"{node.kind}_of({', '.join(parts)})")


def _frontier(outputs: list[Node], known: Mapping[Node, str]) -> dict[int, list[Node]]:
    """Unknown switches that outputs need, by threshold; without those that only other switches need."""
    found: dict[Node, None] = {}
    visited: set[Node] = set()

    def visit(node: Node) -> None:
        if node in known or node in visited:
            return
        visited.add(node)
        if node.kind == "switch" and node.varies:
            found[node] = None
            return
        for part in node.parts:
            visit(part)

    for output in outputs:
        visit(output)
    groups: dict[int, list[Node]] = {}
    for node in found:
        groups.setdefault(node.value, []).append(node)
    return groups


def _straight(writer: _Writer, outputs: list[Node]) -> None:
    """Compute what outputs need; their switches are known."""

    def visit(node: Node) -> None:
        if node not in writer.known:
            for part in node.parts:
                visit(part)
            writer.known[node] = writer.value(node)

    for output in outputs:
        visit(output)


# ---- floats -----------------------------------------------------------------------------------


def float_lines(names: Mapping[str, str], outputs: list[Node], side: str) -> list[str]:
    """Body that returns the values of `outputs` at a speed, as a tuple.

    Parameters
    ----------
    names : mapping of str to str
    outputs : list of Node
    side : str
        Condition for the lower side of a switch; ``{}`` stands for the index of its threshold.
    """
    return _body(names, outputs, partial(_write_for_floats, side=side))


def _body(names: Mapping[str, str], outputs: list[Node], compute: Callable[[_Writer, list[Node]], None]) -> list[str]:
    """Body that returns the values of `outputs`, which `compute` writes."""
    writer = _Writer(names)
    writer.constants(*outputs)
    compute(writer, outputs)
    writer.write("return (" + "".join(f"{writer.known[output]}, " for output in outputs) + ")")
    return writer.lines


def _write_for_floats(writer: _Writer, outputs: list[Node], side: str) -> None:
    """Write the lines of `outputs` for floats: each switch becomes an ``if``."""
    for threshold, switches in _frontier(outputs, writer.known).items():
        _branch(writer, switches, side.format(threshold), partial(_write_for_floats, writer, side=side))
    _straight(writer, outputs)


def _branch(writer: _Writer, switches: list[Node], below: str, compute: Callable[[list[Node]], None]) -> None:
    """Compute switches of one threshold: on each side of it only the parts of that side, by `compute`."""
    targets = [writer.new("0.0") for _ in switches]
    free = most = writer.free
    for k, head in enumerate((f"if {below}:", "else:")):
        parts, writer.free = [node.parts[k] for node in switches], free
        with writer.block(head):
            compute(parts)
            for target, part in zip(targets, parts, strict=True):
                # A constant of which a coefficient is sought has none.
                writer.write(f"{target} = {writer.known.get(part, '0.0')}")
        most = max(most, writer.free)
    writer.free = most
    writer.known.update(zip(switches, targets, strict=True))


def varies_lines(output: Node, side: str) -> list[str]:
    """Body that returns whether an expression depends on the speed, on the present sides of its switches."""

    def text(node: Node) -> str:
        if not node.varies:
            return "False"
        if node.kind == "variable":
            return "True"
        parts = [text(part) for part in node.parts]
        if node.kind == "switch":
            return parts[0] if parts[0] == parts[1] else f"({parts[0]} if {side.format(node.value)} else {parts[1]})"
        needed = [part for part in parts if part != "False"]
        if not needed:
            return "False"
        return "True" if "True" in needed else "(" + " or ".join(needed) + ")"

    return [f"return {text(output)}"]


# ---- vector lanes -----------------------------------------------------------------------------


def lanes_lines(names: Mapping[str, str], outputs: list[Node], threshold: str) -> list[str]:
    """Body that returns the values of `outputs` in vector lanes; ``{}`` in `threshold` stands for an index."""
    return _body(names, outputs, partial(_write_for_lanes, threshold=threshold, context=""))


def _calls(parts: list[Node], known: Mapping[Node, str]) -> bool:
    """Whether parts call a function of the speed; not counting what is behind another switch."""
    return any(
        node.varies
        and node not in known
        and (node.kind in _FUNCTIONS or (node.kind != "switch" and _calls(list(node.parts), known)))
        for node in parts
    )


def _write_for_lanes(writer: _Writer, outputs: list[Node], threshold: str, context: str) -> None:
    """Write the lines of `outputs` for vector lanes: both sides of each switch, where some lane needs them.

    `threshold` is the source text of a threshold, `context` that of the mask within which the lines stand.
    """
    for index, switches in _frontier(outputs, writer.known).items():
        limit = threshold.format(index)
        conditions = [writer.new(f"speed < {limit}"), writer.new(f"speed >= {limit}")]
        found = []
        for k, condition in enumerate(conditions):
            parts = [node.parts[k] for node in switches]
            mask = f"{context} & {condition}" if context else condition
            if _calls(parts, writer.known):
                # Often no lane needs this side.
                targets = [writer.new("spread(0.0)") for _ in parts]
                mask = writer.new(mask)
                with writer.block(f"if any_of({mask}):"):
                    _write_for_lanes(writer, parts, threshold, mask)
                    for target, part in zip(targets, parts, strict=True):
                        writer.write(f"{target} = spread({writer.known[part]})")
                found.append(targets)
            else:
                _write_for_lanes(writer, parts, threshold, mask)
                found.append([writer.known[part] for part in parts])
        for node, below, above in zip(switches, *found, strict=True):
            writer.known[node] = writer.new(f"select({conditions[0]}, {below}, {above})")
    _straight(writer, outputs)


# ---- power series -----------------------------------------------------------------------------


@dataclass(frozen=True)
class SeriesSource:
    """Source code for the power series of expressions, given that of the speed.

    Attributes
    ----------
    start : list of str
        Body that returns coefficient 0 of each output, the numbers that `step` needs, and the sharpness of the
        expressions, all at the speed ``speed``.
    step : list of str
        Body that returns coefficient `k` of each output, then the factors of its products: left ones, right ones. It
        needs the coefficient ``x`` of the speed, ``inner`` with the inner products, and ``begun`` from `start`.
    products : int
        Number of products of two series.
    """

    start: list[str]
    step: list[str]
    products: int


@dataclass
class _Step(_Writer):
    """Writer of coefficient k of each node."""

    needed: dict[tuple[Node, str], str] = field(default_factory=dict)
    products: int = 0

    def begun(self, node: Node, what: str = "value") -> str:
        """A number that is known from the beginning of the series."""
        if what == "value" and node.kind == "number":
            return repr(node.value)
        return self.needed.setdefault((node, what), f"b{len(self.needed)}")

    def product(self) -> int:
        """Number of a new product; sides of a switch share them."""
        self.free += 1
        self.products = max(self.products, self.free)
        return self.free - 1

    def factors(self, number_of: int, left: str, right: str) -> None:
        """Write coefficient k of both factors of a product, which inner products of later steps need."""
        self.write(f"l{number_of} = {left}")
        self.write(f"r{number_of} = {right}")


def series_source(names: Mapping[str, str], outputs: list[Node], side: str) -> SeriesSource:
    """Source code for the power series of expressions; see :func:`float_lines` for the arguments."""
    step = _Step(names)
    # Which side of a switch holds is found once, and not for each coefficient.
    sides = {node.value: f"is_below_{node.value}" for node in nodes_of(*outputs) if node.kind == "switch"}
    _series(step, outputs, "is_below_{}")
    kept = [*step.needed.values(), *sides.values()]
    head = ["(" + "".join(f"{name}, " for name in kept) + ") = begun"] if kept else []
    head += [f"l{i} = r{i} = 0.0" for i in range(step.products)]
    coefficients = "".join(f"{step.known.get(output, '0.0')}, " for output in outputs)
    left, right = ("".join(f"{s}{i}, " for i in range(step.products)) for s in "lr")
    step_lines = [*head, *step.lines, f"return ({coefficients}), ({left}), ({right})"]

    start = _Writer(names)
    start.constants(*outputs, *[derivative(node) for node in nodes_of(*outputs)])
    start.write("sharpness = 0.0")
    for (node, what), name in step.needed.items():
        start.write(f"{name} = {start.known[node] if what == 'value' and not node.varies else '0.0'}")
    _begin(start, step, outputs, side)
    values = "".join(f"{start.known[output]}, " for output in outputs)
    for threshold, name in sides.items():
        start.write(f"{name} = {side.format(threshold)}")
    start.write(f"return ({values}), ({''.join(f'{name}, ' for name in kept)}), sharpness")
    return SeriesSource(start.lines, step_lines, step.products)


def _begin(writer: _Writer, step: _Step, outputs: list[Node], side: str) -> None:
    """Compute coefficient 0 of outputs, and all that the steps need of it."""
    for threshold, switches in _frontier(outputs, writer.known).items():
        _branch(writer, switches, side.format(threshold), partial(_begin, writer, step, side=side))
        for node in switches:
            _keep(writer, step, node, side)
    before, nodes = set(writer.known), nodes_of(*outputs)
    _straight(writer, outputs)
    for node in nodes:
        if node in writer.known and node not in before:
            _keep(writer, step, node, side)
            parts = quotient_of(node) if node.varies and node.kind in _FUNCTIONS else ()
            for part in parts:
                _straight(writer, [part])
                if part not in nodes and node.kind != "tanh":
                    _keep(writer, step, part, side)


def _keep(writer: _Writer, step: _Step, node: Node, side: str) -> None:
    """Store what the steps need of a node, and the rate at which it changes."""
    value = writer.known[node]
    if (node, "value") in step.needed:
        writer.write(f"{step.needed[node, 'value']} = {value}")
    if (node, "inverse") in step.needed:
        writer.write(f"{step.needed[node, 'inverse']} = 1.0 / {value}")
    if node.kind == "tanh" and (rest := (quotient_of(node)[0], "value")) in step.needed:
        # 1 - tanh^2 without cancellation.
        decayed = writer.new(f"exp_of(-2.0 * abs({writer.known[node.parts[0]]}))")
        share = writer.new(f"1.0 + {decayed}")
        writer.write(f"{step.needed[rest]} = 4.0 * {decayed} / ({share} * {share})")
    if node.varies and node.kind in ("exp", "tanh"):
        scale = 2.0 if node.kind == "tanh" else 1.0
        _sharpen(writer, node.parts[0], "1.0", scale, side)
    elif node.varies and (base := singular(node)) is not None and base.varies:
        # The series converges up to the zero of this expression that is nearest in the complex plane. Where a narrow
        # peak is still far its terms are too small to tell, so that a step would lead across it.
        _straight(writer, [base])
        _sharpen(writer, base, writer.new(f"abs({writer.known[base]})"), 4.0, side)


def singular(node: Node) -> Node | None:
    """Expression at whose zeros a node has no power series."""
    if node.kind == "divide":
        return node.parts[1]
    if node.kind not in _FUNCTIONS:
        return None
    divisor = quotient_of(node)[1]
    return node.parts[0] if divisor is node else divisor


def _sharpen(writer: _Writer, inner: Node, unit: str, scale: float, side: str) -> None:
    """Take the rate at which an expression changes, in a unit, into the sharpness."""
    rates = [derivative(inner), derivative(derivative(inner))]
    _write_for_floats(writer, rates, side)
    first, second = (writer.known[rate] for rate in rates)
    share = "" if unit == "1.0" else f" / {unit}"
    change = f"abs({first}){share} + 2.0 * sqrt_of(0.5 * abs({second}){share})"
    writer.write(f"sharpness = max(sharpness, {scale} * ({change}))")


def _series(step: _Step, outputs: list[Node], side: str) -> None:
    """Write coefficient k of outputs."""
    for threshold, switches in _frontier([o for o in outputs if o.varies], step.known).items():
        _branch(step, switches, side.format(threshold), partial(_series, step, side=side))
    for output in outputs:
        _visit(step, output)


def _visit(step: _Step, node: Node) -> str:
    """Name of coefficient k of a node; its parts are written first."""
    if node.varies and node not in step.known:
        for part in node.parts:
            _visit(step, part)
        step.known[node] = _coefficient(step, node)
    return step.known.get(node, "0.0")


def _coefficient(step: _Step, node: Node) -> str:
    """Name of coefficient k of a node whose parts are known."""
    if node.kind == "variable":
        return "x"
    k = [step.known[part] if part.varies else "0.0" for part in node.parts]
    p = node.parts
    if node.kind == "add":
        return step.new(" + ".join(name for name, part in zip(k, p, strict=True) if part.varies))
    if node.kind == "multiply":
        if not p[0].varies:
            return step.new(f"{step.begun(p[0])} * {k[1]}")
        i = step.product()
        if p[0] is p[1]:
            found = step.new(f"2.0 * {step.begun(p[0])} * {k[0]} + inner[{i}]")
        else:
            found = step.new(f"{step.begun(p[0])} * {k[1]} + {k[0]} * {step.begun(p[1])} + inner[{i}]")
        step.factors(i, k[0], k[1])
        return found
    i = step.product()
    if node.kind == "divide":
        dividend = f"{k[0]} - " if p[0].varies else "-"
        text = f"{step.begun(node)} * {k[1]} + inner[{i}]"
        found = step.new(f"({dividend}({text})) * {step.begun(p[1], 'inverse')}")
        step.factors(i, found, k[1])
        return found
    # The rate of a function, times the divisor of its derivative, is the rate of its argument times the dividend.
    above, below = quotient_of(node)
    text = f"{step.begun(above)} * {k[0]}"
    if above.varies:
        text += f" + INVERSE[k] * inner[{i}]"
    j = step.product() if above.varies and below.varies else i
    if below.varies:
        text = f"({text} - INVERSE[k] * inner[{j}]) * {step.begun(below, 'inverse')}"
    found = step.known[node] = step.new(text)
    if above.varies:
        step.factors(i, f"k * {k[0]}", _visit(step, above))
    if below.varies:
        step.factors(j, f"k * {found}", _visit(step, below))
    return found


# ---- power series in the variable itself ------------------------------------------------------

# Polynomials up to this degree have their coefficients in the place of a series.
_MOST_DEGREE = 4

#: Rows of the scratch for :func:`taylor_lines`.
SERIES_ROWS = 36


@cache
def _degree(node: Node) -> int | None:
    """Degree of a polynomial, at most 4; None for a higher one and for anything else."""
    if not node.varies or node.kind == "held":
        return 0
    if node.kind == "variable":
        return 1
    degrees = [degree for part in node.parts if (degree := _degree(part)) is not None]
    if node.kind not in ("add", "multiply", "switch") or len(degrees) < len(node.parts):
        return None
    found = sum(degrees) if node.kind == "multiply" else max(degrees)
    return found if found <= _MOST_DEGREE else None


def is_polynomial(node: Node) -> bool:
    """Whether a node is a polynomial of degree 4 or less between its switches."""
    return _degree(node) is not None


def _rows_of(rate: Node) -> tuple[list[Node], dict[Node, int], set[Node], dict[Node, list[Node]]]:
    """Rate and slopes that need a series, row of each series, expressions that are sums, coefficients of polynomials.

    Sums and multiples that one expression uses are written into it. A factor of a product has a row; of two polynomials
    whose product has too high a degree, one.
    """
    found = [rate]
    for node in found:
        slopes = [derivative(part) for part in nodes_of(node) if part.varies and part.kind in _FUNCTIONS]
        found += [slope for slope in slopes if slope not in found]
    every = nodes_of(*found)
    others = [node for node in every if not is_polynomial(node)]
    users = Counter([part for node in others for part in set(node.parts)])
    users.update(derivative(node) for node in others if node.kind in _FUNCTIONS)
    products = [node for node in others if node.kind == "divide" or (node.kind == "multiply" and node.parts[0].varies)]
    rows = {part for node in products for part in node.parts if not is_polynomial(part)}
    rows |= {node.parts[1] for node in products if node.kind == "multiply" and not rows.intersection(node.parts)}
    linear = {node for node in others if node.kind == "add" or (node.kind == "multiply" and not node.parts[0].varies)}
    rows |= {node for node in others if node not in linear or users[node] > 1}
    place = {node: i for i, node in enumerate(node for node in every if node in rows)}
    needed = {part for node in others if node.kind not in _FUNCTIONS for part in node.parts} | {rate}
    needed |= {derivative(node) for node in others if node.kind in _FUNCTIONS}
    coefficients = {node: _coefficients(node) for node in every if node in needed and is_polynomial(node)}
    return found, place, linear, coefficients


def taylor_lines(names: Mapping[str, str], value: Node, rate: Node, side: str, factor: str) -> list[str]:
    """Body that fills the array ``theta`` with the power series of an expression in the variable, up to ``order``.

    Coefficients of a function follow from those of its derivative, which is an expression of the same functions. The
    lines need an array ``work`` of shape ``(SERIES_ROWS, order + 1)``.

    Parameters
    ----------
    names : mapping of str to str
    value, rate : Node
        The expression, and its derivative.
    side : str
        As for :func:`float_lines`.
    factor : str
        Source text of a factor on the series.

    Raises
    ------
    OverflowError
        If there are more series than the scratch has rows.
    """
    writer = _Writer(names)
    found, place, linear, coefficients = _rows_of(rate)
    if len(place) > SERIES_ROWS:
        raise OverflowError
    numbers = [one for several in coefficients.values() for one in several]
    writer.constants(value, *found, *numbers)
    _write_for_floats(writer, [value, *place, *numbers], side)

    stored: set[int] = set()
    lags: dict[int, int] = dict.fromkeys(place.values(), 1)

    def row(node: Node, lag: int) -> str:
        """Coefficient k less a lag of a node with a row: a number that is still in a register."""
        i = place[node]
        lags[i] = max(lags[i], lag)
        return f"w{i}_{lag}"

    def term(node: Node, lag: int) -> str:
        """Coefficient k less a lag of a node."""
        if node in place:
            return row(node, lag)
        return polynomial(node, lag) if is_polynomial(node) else linear_text(node, lag)

    def linear_text(node: Node, lag: int) -> str:
        a, b = node.parts
        if node.kind == "multiply":
            return f"{writer.known[a]} * {term(b, lag)}"
        # A constant has a coefficient 0 only.
        return "(" + " + ".join(term(part, lag) for part in (a, b) if part.varies or lag) + ")"

    def polynomial(node: Node, lag: int) -> str:
        choices = (f"{writer.known[p]} if k == {j + lag} else " for j, p in enumerate(coefficients[node]))
        return "(" + "".join(choices) + "0.0)"

    def product(left: Node, right: Node, first: int, scale: str = "", sign: str = "+") -> str:
        """Coefficient k of a product, with the coefficients of the left factor from `first` on; or less each term."""
        if left in place:
            stored.update((place[left], place[right]))
            writer.write("total = 0.0")
            with writer.block(f"for j in range({first}, k + 1):"):
                writer.write(f"total += work[{place[left]}, j] * work[{place[right]}, k - j]")
            return "total" + scale
        # The newest coefficient comes last, so that the next one waits for one multiplication and addition.
        terms = list(enumerate(coefficients[left]))[first:]
        return f" {sign} ".join(f"{writer.known[p]}{scale} * {row(right, j)}" for j, p in reversed(terms))

    writer.write(f"factor = {factor}")
    inverses = {node: writer.new(f"1.0 / {writer.known[node.parts[1]]}") for node in place if node.kind == "divide"}
    begin = len(writer.lines)
    writer.write(f"theta[0] = factor * {writer.known[value]}")
    with writer.block("for k in range(1, order + 1):"):
        writer.write(f"theta[k] = factor * {term(rate, 1)} * INVERSE[k]")
        for node, i in place.items():
            p = node.parts
            if is_polynomial(node):
                text = polynomial(node, 0)
            elif node in linear:
                text = linear_text(node, 0)
            elif node.kind == "multiply":
                text = product(p[0], p[1], 0) if p[1] in place else product(p[1], p[0], 0)
            elif node.kind == "divide":
                # Each factor on coefficients before is known before the loop, which waits for nothing else.
                dividend = f"{term(p[0], 0)} * {inverses[node]} " if p[0].varies else ""
                text = f"{dividend}- {product(p[1], node, 1, f' * {inverses[node]}', '-')}"
            elif node.kind == "switch":
                text = f"{term(p[0], 0)} if {side.format(node.value)} else {term(p[1], 0)}"
            else:
                text = f"{term(derivative(node), 1)} * INVERSE[k]"
            writer.write(f"w{i}_0 = {text}")
            writer.write(f"work[{i}, k] = w{i}_0")
        for i, most in lags.items():
            for lag in range(most, 0, -1):
                writer.write(f"w{i}_{lag} = w{i}_{lag - 1}")
    # Only factors of products of series are read from the scratch.
    writer.lines[:] = [line for line in writer.lines if not any(f"work[{i}, k] =" in line for i in {*lags} - stored)]
    for node, i in place.items():
        started = [f"w{i}_1 = {writer.known[node]}", *(f"w{i}_{lag} = 0.0" for lag in range(2, lags[i] + 1))]
        writer.lines[begin:begin] = [*started, *([f"work[{i}, 0] = {writer.known[node]}"] if i in stored else [])]
    return writer.lines


def reach_lines(names: Mapping[str, str], output: Node, side: str) -> list[str]:
    """Lines that shorten ``h``, from the variable on, so that a power series within it sees all features ahead.

    Where a narrow feature is still far, the terms of the series are too small to tell of it. The lines call
    ``time_of(distance, first, second)``: how long an expression with these derivatives needs for a distance.
    """
    writer = _Writer(names)
    bounds = []
    for node in nodes_of(output):
        if node.varies and node.kind in ("exp", "tanh"):
            # Beyond these arguments the functions are constant but for rounding.
            far = "-40.0 - {}" if node.kind == "exp" else "abs({}) - 20.0"
            bounds.append((node.parts[0], f"max({4.0 if node.kind == 'exp' else 2.0}, {far})"))
        elif node.varies and (base := singular(node)) is not None and base.varies:
            bounds.append((base, "0.5 * abs({})"))
    for inner, distance in bounds:
        parts = [inner, derivative(inner), derivative(derivative(inner))]
        writer.constants(*parts)
        _write_for_floats(writer, parts, side)
        value, first, second = (writer.known[part] for part in parts)
        writer.write(f"h = min(h, time_of({distance.format(value)}, {first}, {second}))")
    return writer.lines


def _coefficients(polynomial: Node) -> list[Node]:
    """Coefficients of the power series of a polynomial."""
    found = [polynomial]
    for k in range(1, (_degree(polynomial) or 0) + 1):
        found.append(multiply(number(1.0 / k), derivative(found[-1])))
    return found
