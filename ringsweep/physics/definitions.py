"""Types that formulas define: of friction laws, of drives and of forces.

Such a type has the name of a module and a qualified name, by which a compiled kernel in the cache finds it again.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Callable

_PREFIX = "formula_"


class Definitions:
    """Types that formulas have defined in a module, each of them made once.

    Code on disk names a type by its module and its qualified name. So the name tells the definition, and the module
    finds the type by the name.

    Parameters
    ----------
    module : str
        Name of the module.
    make : callable
        Makes the type from its name, its qualified name and the parts of its definition.

    Attributes
    ----------
    known : dict of str to type
        Types by qualified name.
    """

    def __init__(self, module: str, make: Callable[..., type]):
        """Remember in which module types are found, and the function that makes one."""
        self.module, self.make = module, make
        self.known: dict[str, type] = {}

    def type_of(self, *parts: str | None) -> type:
        """Type that a definition makes, from the parts of the definition."""
        encoded = base64.urlsafe_b64encode(json.dumps(parts).encode())
        return self.find(_PREFIX + encoded.decode().rstrip("="))

    def find(self, qualified: str) -> type:
        """Type by its qualified name; the ``__getattr__`` of the module."""
        if not qualified.startswith(_PREFIX):
            raise AttributeError(f"module {self.module} has no attribute {qualified}")
        if qualified not in self.known:
            encoded = qualified.removeprefix(_PREFIX).encode()
            parts = json.loads(base64.urlsafe_b64decode(encoded + b"=" * (-len(encoded) % 4)))
            name = "Formula_" + hashlib.sha256(qualified.encode()).hexdigest()[:12]
            self.known[qualified] = self.make(name, qualified, *parts)
        return self.known[qualified]
