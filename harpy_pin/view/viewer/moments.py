"""The newest moment of a loop, in memory that two processes share: the writer never waits for the
reader.
"""

import mmap
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harpy_pin.model.robot import Robot
from harpy_pin.model.state import Vector

COUNTER = 8
"""Bytes before the numbers."""


def moment_type(robot: Robot) -> np.dtype[np.void]:
    """One moment of a robot: signals of a run, by their names, of float64.

    The references ``x_r`` and ``x_w`` come last: they alone may be NaN, where there is none.
    """
    feet, thrusters = (len(robot.feet), 3), (len(robot.thrusters), 3)
    shapes = {
        "t": (),
        "q": (robot.nq,),
        "foot_position": feet,
        "foot_velocity": feet,
        "foot_force": feet,
        "thrust": thrusters,
        "x_r": (3,),
        "x_w": (3,),
    }
    return np.dtype([(name, np.float64, shape) for name, shape in shapes.items()])


class Slot:
    """Holds one moment, with a counter before it that is odd while the moment is being written.

    Args:
        file: descriptor of a file of :meth:`size` bytes.
        kind: of the moment, see :func:`moment_type`.
    """

    def __init__(self, file: int, kind: np.dtype[np.void]) -> None:
        memory = mmap.mmap(file, self.size(kind))
        self._count = np.frombuffer(memory, np.int64, 1)
        self._moment = np.frombuffer(memory, kind, 1, COUNTER)
        self._all = self._moment.view(np.float64)
        self._writes = count(1)

    @staticmethod
    def size(kind: np.dtype[np.void]) -> int:
        """Bytes of a slot."""
        return COUNTER + kind.itemsize

    def write(self, numbers: Vector) -> None:
        """Replace the moment by another: all its numbers, one after the other."""
        number = 2 * next(self._writes)
        self._count[0] = number - 1
        self._all[:] = numbers
        self._count[0] = number

    def read(self, since: int) -> tuple[NDArray[Any], int] | None:
        """A copy of the moment (1,) and its number; None where it is the one of number ``since``,
        or half written.
        """
        number = int(self._count[0])
        moment = self._moment.copy()
        if number == since or number % 2 or number != int(self._count[0]):
            return None
        return moment, number
