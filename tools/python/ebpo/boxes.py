"""Which of many boxes points and rays come to: a tree over boxes, and order along the Morton curve."""
from __future__ import annotations

from typing import Callable

import numpy as np

FAN = 8  # children of a node of the tree
GROUP = 64  # points, one after the other on the curve, that go down the tree together
# Lengths here are rounded some ten times, by 2^-53 each; what is dropped is farther than this share more.
SLACK = 2.0**-40

Pairs = tuple[np.ndarray, np.ndarray]


def morton_order(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(n,) int64: the order of points along the Morton curve of a box; those outside count as on its sides."""
    with np.errstate(all="ignore"):
        share = (points - low) / np.where(high > low, high - low, 1.0)
    steps = (np.clip(np.nan_to_num(share), 0, 1) * (2**21 - 1)).astype(np.uint64)
    code = np.zeros(len(points), np.uint64)
    for axis in range(3):
        bits = steps[:, axis]
        for shift, mask in ((32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F),
                            (4, 0x10C30C30C30C30C3), (2, 0x1249249249249249)):
            bits = (bits | bits << np.uint64(shift)) & np.uint64(mask)
        code |= bits << np.uint64(axis)
    return np.argsort(code, kind="stable")


def least_lengths(low: np.ndarray, high: np.ndarray, other_low: np.ndarray, other_high: np.ndarray) -> np.ndarray:
    """Between boxes, row by row: 0 where they meet."""
    return length(np.maximum(np.maximum(other_low - high, low - other_high), 0))


def greatest_lengths(low: np.ndarray, high: np.ndarray, other_low: np.ndarray, other_high: np.ndarray) -> np.ndarray:
    """Between a point of one and a point of the other."""
    return length(np.maximum(other_high - low, high - other_low))


def length(rows: np.ndarray) -> np.ndarray:
    """Of vectors, also where squares are beyond doubles; inf where it is itself."""
    with np.errstate(over="ignore"):
        return np.hypot(np.hypot(rows[:, 0], rows[:, 1]), rows[:, 2])


class Boxes:
    """A tree over (m, 3) lower and upper corners, all closed; immutable, for any number of threads.

    among: numbers of the boxes that count, at least one.
    """

    def __init__(self, low: np.ndarray, high: np.ndarray, among: np.ndarray) -> None:
        self.low, self.high = low, high
        centres = low[among] / 2 + high[among] / 2
        self.order = among[morton_order(centres, centres.min(axis=0), centres.max(axis=0))]
        levels = [(low[self.order], high[self.order])]
        while len(levels[-1][0]) > FAN:
            begins = np.arange(0, len(levels[-1][0]), FAN)
            levels.append((np.minimum.reduceat(levels[-1][0], begins), np.maximum.reduceat(levels[-1][1], begins)))
        self.levels = levels

    def descend(self, count: int, keep: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]) -> Pairs:
        """Pairs (query, box) that are kept from the root down: keep(queries, low, high) says of each pair."""
        top = len(self.levels[-1][0])
        query, node = np.repeat(np.arange(count), top), np.tile(np.arange(top), count)
        for level in reversed(range(len(self.levels))):
            low, high = self.levels[level]
            kept = keep(query, low[node], high[node])
            query, node = query[kept], node[kept]
            if level:
                query, node = np.repeat(query, FAN), (node[:, None] * FAN + np.arange(FAN)).ravel()
                there = node < len(self.levels[level - 1][0])
                query, node = query[there], node[there]
        return query, self.order[node]

    @staticmethod
    def groups(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        begins = np.arange(0, len(points), GROUP)
        return np.minimum.reduceat(points, begins), np.maximum.reduceat(points, begins)

    @staticmethod
    def of_groups(group: np.ndarray, box: np.ndarray, count: int) -> Pairs:
        """Pairs of points from those of their groups."""
        point = (group[:, None] * GROUP + np.arange(GROUP)).ravel()
        box = np.repeat(box, GROUP)
        there = point < count
        return point[there], box[there]

    def containing(self, points: np.ndarray) -> Pairs:
        """All pairs (point, box that holds it), by box, then by point."""
        low, high = self.groups(points)
        group, box = self.descend(len(low), lambda g, l, h: ((low[g] <= h) & (l <= high[g])).all(axis=1))
        point, box = self.of_groups(group, box, len(points))
        held = ((self.low[box] <= points[point]) & (points[point] <= self.high[box])).all(axis=1)
        return by_box(point[held], box[held])

    def nearest(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pairs (point, box) and how far away the box is at least, by point, the nearest box first.

        What is in a box that is not named is farther from the point than what is in one that is.
        """
        low, high = self.groups(points)
        most = np.full(len(low), np.inf)

        def keep(group: np.ndarray, l: np.ndarray, h: np.ndarray) -> np.ndarray:
            np.minimum.at(most, group, greatest_lengths(low[group], high[group], l, h))
            return least_lengths(low[group], high[group], l, h) * (1 - SLACK) <= most[group]

        group, box = self.descend(len(low), keep)
        point, box = self.of_groups(group, box, len(points))
        p = points[point]
        least = least_lengths(p, p, self.low[box], self.high[box])
        far = np.full(len(points), np.inf)
        np.minimum.at(far, point, greatest_lengths(p, p, self.low[box], self.high[box]))
        kept = least * (1 - SLACK) <= far[point]
        point, box, least = point[kept], box[kept], least[kept]
        order = np.lexsort((box, least, point))
        return point[order], box[order], least[order]

    def on_rays(self, origins: np.ndarray, directions: np.ndarray) -> Pairs:
        """Pairs (ray, box that it may meet), by box, then by ray: none that is met is missing."""
        size = np.maximum(np.abs(self.low), np.abs(self.high)).max(initial=0)

        def keep(ray: np.ndarray, l: np.ndarray, h: np.ndarray) -> np.ndarray:
            o, d = origins[ray], directions[ray]
            pad = SLACK * (np.abs(o).max(axis=1, initial=0) + size)[:, None]
            with np.errstate(all="ignore"):
                one, other = (l - pad - o) / d, (h + pad - o) / d
            along = d != 0
            beside = ~along & ((o < l - pad) | (o > h + pad))
            near = np.where(along, np.fmin(one, other), -np.inf).max(axis=1)
            far = np.where(along, np.fmax(one, other), np.inf).min(axis=1)
            with np.errstate(invalid="ignore"):
                missed = (near > far + SLACK * np.abs(far)) | (far < 0)
            return ~beside.any(axis=1) & ~missed

        ray, box = self.descend(len(origins), keep)
        return by_box(ray, box)


def by_box(query: np.ndarray, box: np.ndarray) -> Pairs:
    order = np.lexsort((query, box))
    return query[order], box[order]
