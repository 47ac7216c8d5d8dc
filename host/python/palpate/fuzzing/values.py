"""Values that are seldom right."""

import datetime
from collections.abc import Callable
from typing import Any

from palpate.fuzzing.draw import Draw

_ODD: tuple[Any, ...] = (
    0, 1, -1, 2, 3, 2**31, -(2**31) - 1, 2**63 - 1, 2**64, 10**400,
    0.0, -0.0, 1e-308, 1e308, -1e308, 1e-9, 1e9, float("nan"), float("inf"), float("-inf"),
    True, False, "", "auto", "x", "ä\u0000\n\"", "a" * 5000, [], [[]], {}, [0], [1, 2], [1.0, "a"], {"x": {}},
    datetime.date(2020, 1, 1),
)


def odd_value(draw: Draw) -> Any:
    """One of them."""
    return draw.choice(_ODD)


def mutate_tree(tree: Any, draw: Draw) -> Any:
    """A copy of nested dictionaries and lists with one to three places changed: to an odd value, to the value of another
    place, to a number near its own, removed, doubled, or with a key that nobody knows."""
    tree = _copy(tree)
    for _ in range(draw.randint(1, 3)):
        places = list(_places(tree))
        if not places:
            return tree
        holder, key = draw.choice(places)
        _CHANGES[draw.randrange(len(_CHANGES))](holder, key, places, draw)
    return tree


def _copy(tree: Any) -> Any:
    if isinstance(tree, dict):
        return {name: _copy(value) for name, value in tree.items()}
    return [_copy(value) for value in tree] if isinstance(tree, list) else tree


def _places(tree: Any) -> Any:
    items = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in items:
        yield tree, key
        if isinstance(value, dict | list):
            yield from _places(value)


Change = Callable[[Any, Any, list[tuple[Any, Any]], Draw], None]


def _put_odd(holder: Any, key: Any, _: Any, draw: Draw) -> None:
    holder[key] = _copy(odd_value(draw))


def _put_other(holder: Any, key: Any, places: list[tuple[Any, Any]], draw: Draw) -> None:
    other, its_key = draw.choice(places)
    holder[key] = _copy(other[its_key])


def _scale(holder: Any, key: Any, _: Any, draw: Draw) -> None:
    value = holder[key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        return
    factor = draw.choice((-1, 0.1, 0.5, 2, 3, 10, 1000))
    holder[key] = int(value * factor) if isinstance(value, int) else value * factor


def _remove(holder: Any, key: Any, _: Any, __: Draw) -> None:
    del holder[key]


def _double(holder: Any, key: Any, _: Any, draw: Draw) -> None:
    if isinstance(holder, list):
        holder.insert(draw.randint(0, len(holder)), _copy(holder[key]))
    else:
        holder["unknown_key"] = _copy(holder[key])


_CHANGES: tuple[Change, ...] = (_put_odd, _put_odd, _put_other, _scale, _scale, _remove, _double)
