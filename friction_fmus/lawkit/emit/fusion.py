"""Operations on elements of vectors in as few loops as possible."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TypeVar

Key = TypeVar("Key")


def in_loops(
    ordered: Sequence[Key], waits: Mapping[Key, set[Key]], lanes: Mapping[Key, int], sums: Collection[Key]
) -> list[list[Key]]:
    """Return steps, each of one unit outside loops or of the units of one loop.

    A loop contains what the units after it need, and what needs its elements; other operations on elements wait for a
    later loop, so that their results need not be stored.
    """
    steps: list[list[Key]] = []
    left = list(ordered)
    while left:
        for key in [key for key in left if not lanes[key]]:
            if not waits[key] & {*left}:
                steps.append([key])
                left.remove(key)
        if not left:
            break
        loop = _next_loop(left, waits, lanes, sums)
        steps.append(loop)
        left = [key for key in left if key not in loop]
    return steps


def _next_loop(
    left: Sequence[Key], waits: Mapping[Key, set[Key]], lanes: Mapping[Key, int], sums: Collection[Key]
) -> list[Key]:
    """Return the units of the next loop."""
    possible: list[Key] = []
    for key in left:
        missing = waits[key] & {*left}
        same = not possible or lanes[key] == lanes[possible[0]]
        if lanes[key] and same and missing <= {*possible} - {*sums}:
            possible.append(key)
    wanted = [key for key in possible if key in sums]
    if not wanted:
        after = [key for key in left if not lanes[key]]
        wanted = [key for key in possible if any(key in waits[other] for other in after)] or possible
    found = _with_arguments(wanted, possible, waits)
    return _with_arguments(_with_users(found, possible, waits), possible, waits)


def _with_arguments(wanted: Collection[Key], possible: Sequence[Key], waits: Mapping[Key, set[Key]]) -> list[Key]:
    """Return the wanted units and those of the same loop for which they wait."""
    found = {*wanted}
    for key in reversed(possible):
        if key in found:
            found |= waits[key] & {*possible}
    return [key for key in possible if key in found]


def _with_users(wanted: Collection[Key], possible: Sequence[Key], waits: Mapping[Key, set[Key]]) -> set[Key]:
    """Return the wanted units and those of the same loop that wait for them."""
    found = {*wanted}
    for key in possible:
        if waits[key] & found:
            found.add(key)
    return found
