"""Replays of recorded inputs: states through a controller, a governor's updates, a solver's
programs.

Every replay presents its inputs in the order of time and keeps every result, outside the timed
span, so that what was timed can be compared with what should have come out. It goes on block by
block, so that several can be interleaved.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from time import perf_counter_ns, thread_time_ns
from typing import Any

import numpy as np

import harpy_pin as hp
from comparison.measure.timing import Laps
from harpy_pin.model.record import Record
from harpy_pin.model.state import Command, State, Vector
from harpy_pin.wbc.solvers import ProxQPSolver

WBC_PHASES = ("kinematics", "build", "solve", "finish")
"""Gait and rigid-body terms; task accelerations and the program's arrays; the solver; torques and
thrusts.
"""


class TickReplay:
    """Times the complete tick, ``step(state)``, of a controller.

    Attributes:
        phases: names of the columns of :attr:`laps`.
        laps: (ticks, phases) exclusive times, ns; their sum over a row is the tick.
        commands: (ticks, joints + 3 thrusters) torques (N·m) and thrusts (N).
    """

    phases: tuple[str, ...] = ("tick",)

    def __init__(self, controller: Any) -> None:
        self.controller = controller
        self.start(())

    def start(self, states: Sequence[State]) -> None:
        """Begin a sequence: the controller forgets the one before."""
        robot = self.controller.robot
        self.states = states
        self.laps: Laps = np.zeros((len(states), len(self.phases)), dtype=np.int64)
        self.commands: Vector = np.full(
            (len(states), len(robot.joints) + 3 * len(robot.thrusters)), np.nan
        )
        self.controller.reset()

    def time_block(self, begin: int, end: int) -> None:
        """Replay the states from ``begin`` to before ``end``; blocks must follow each other."""
        step, clock = self.controller.step, perf_counter_ns
        for i in range(begin, min(end, len(self.states))):
            state = self.states[i]
            t0 = clock()
            command = step(state)
            t1 = clock()
            self.laps[i, 0] = t1 - t0
            self._keep(i, command)

    def _keep(self, i: int, command: Command) -> None:
        row, joints = self.commands[i], len(command.torque)
        row[:joints] = command.torque
        row[joints:] = command.thrust.ravel()


class WholeBodyChain(TickReplay):
    """Times the phases of :data:`WBC_PHASES`; each ends where the next begins."""

    phases = WBC_PHASES

    def time_block(self, begin: int, end: int) -> None:
        """See :meth:`TickReplay.time_block`."""
        c, clock = self.controller, perf_counter_ns
        prepare, build, solve, finish = c.prepare, c.build, c.solve, c.finish
        for i in range(begin, min(end, len(self.states))):
            state = self.states[i]
            t0 = clock()
            prepare(state)
            t1 = clock()
            build(state)
            t2 = clock()
            solve()
            t3 = clock()
            command = finish(state)
            t4 = clock()
            self.laps[i] = t1 - t0, t2 - t1, t3 - t2, t4 - t3
            self._keep(i, command)


class TimedProxQP(ProxQPSolver):
    """ProxQP with its own timer on.

    Attributes:
        spent: what that says of all solves so far, µs.
    """

    def __init__(self, program: hp.wbc.QuadraticProgram) -> None:
        super().__init__(program)
        self._qp.settings.compute_timings = True
        self.spent = 0.0

    def _attempt(self, program: hp.wbc.QuadraticProgram, *, warm: bool) -> hp.wbc.QPStatus:
        status = super()._attempt(program, warm=warm)
        info = self._qp.results.info
        self.spent += info.setup_time + info.solve_time
        return status


class ProxQPReplay(TickReplay):
    """Replays a whole-body QP whose solver is :class:`TimedProxQP`: its times are those of ProxQP's
    own timer.

    They are what ProxQP itself takes of a tick; Python, and what hands the program over to it, are
    not in them.
    """

    def __init__(
        self, make: Callable[[Callable[[hp.wbc.QuadraticProgram], hp.wbc.QPSolver]], Any]
    ) -> None:
        made: list[TimedProxQP] = []

        def solver(program: hp.wbc.QuadraticProgram) -> TimedProxQP:
            made.append(TimedProxQP(program))
            return made[-1]

        super().__init__(make(solver))
        self._solver = made[-1]

    def time_block(self, begin: int, end: int) -> None:
        """See :meth:`TickReplay.time_block`."""
        step, solver = self.controller.step, self._solver
        for i in range(begin, min(end, len(self.states))):
            before = solver.spent
            command = step(self.states[i])
            self.laps[i, 0] = round(1e3 * (solver.spent - before))
            self._keep(i, command)


def replay(timer: TickReplay, states: Sequence[State]) -> TickReplay:
    """Replay a whole sequence in one go; returns the timer with its times and commands."""
    timer.start(states)
    timer.time_block(0, len(states))
    return timer


@dataclass(frozen=True)
class GovernorTrace:
    """Inputs and outputs of the governor over a sequence."""

    start: Vector  # (6,) reference it was reset to
    measured: Vector  # (ticks, 9) [c; ċ; u]
    references: Vector  # (ticks, 6) x_r
    results: Vector  # (ticks, 6) x_w
    active: float  # share of ticks with a violated row, at x_r or at x_w
    infeasible: float  # share of ticks with a violated row at both


class IsolatedGovernor:
    """Times one update of the governor after the other.

    Attributes:
        laps: (ticks,) times, ns.
        difference: largest difference from the expected x_w so far (m, m/s).
    """

    def __init__(self, governor: hp.governors.Governor, dt: float) -> None:
        self.governor, self.dt = governor, dt
        self.laps: Laps = np.zeros(0, dtype=np.int64)
        self.difference = 0.0

    def start(self, trace: GovernorTrace) -> None:
        """Begin a sequence."""
        self.trace = trace
        self.laps = np.zeros(len(trace.measured), dtype=np.int64)
        self.governor.reset(trace.start)

    def time_block(self, begin: int, end: int) -> None:
        """Time the updates from ``begin`` to before ``end``."""
        trace, dt, clock, update = self.trace, self.dt, perf_counter_ns, self.governor.update
        for i in range(begin, min(end, len(self.laps))):
            x, x_r = trace.measured[i], trace.references[i]
            t0 = clock()
            x_w = update(x, x_r, dt)
            t1 = clock()
            self.laps[i] = t1 - t0
            self.difference = max(self.difference, float(np.abs(x_w - trace.results[i]).max()))


class IsolatedSolver:
    """Times one solver on recorded programs, one solve after the other as in a walk.

    The program is filled with the recorded ones outside the timed span.

    Attributes:
        laps: (programs,) times, ns.
        gaps: (programs,) how far the objective lies above that of the expected solution, relative
            to its size, in the present sequence; NaN where one of the two is missing.
        failures: programs of the present sequence that were not solved.
    """

    def __init__(self, program: hp.wbc.QuadraticProgram, solver: str) -> None:
        self.program = program
        self.solver = hp.wbc.make_solver(solver, program)

    def start(self, programs: Record, expected: Vector) -> None:
        """Begin a sequence of programs with a cold solver; ``expected``: their solutions, NaN where
        there is none.
        """
        self.programs, self.expected = programs, expected
        self.laps: Laps = np.zeros(len(programs), dtype=np.int64)
        self.gaps: Vector = np.full(len(programs), np.nan)
        self.failures = 0
        self.solver.reset()

    def time_block(self, begin: int, end: int) -> None:
        """Time the solves from ``begin`` to before ``end``."""
        program, clock = self.program, perf_counter_ns
        for i in range(begin, min(end, len(self.laps))):
            program._record_[0] = self.programs[i]
            t0 = clock()
            solution = self.solver.solve(program)
            t1 = clock()
            self.laps[i] = t1 - t0
            if solution.usable:
                best = program.objective(self.expected[i])
                self.gaps[i] = (program.objective(solution.z) - best) / max(abs(best), 1.0)
            else:
                self.failures += 1


FIRST = 10
"""Ticks that are not timed: they load what every tick needs."""


class _Timed:
    """A controller whose ticks are timed, and of another one that is given the same states.

    Attributes:
        ticks: of both, ns.
        apart: largest difference of the torques, as a share of the largest torque.
    """

    def __init__(self, controller: Any, other: hp.Controller | None) -> None:
        self._controller, self._other = controller, other
        self.ticks: list[tuple[int, int]] = []
        self.apart: list[float] = []

    def __getattr__(self, name: str) -> Any:
        return getattr(self._controller, name)

    def step(self, state: State) -> Command:
        begin = thread_time_ns()
        command: Command = self._controller.step(state)
        between = thread_time_ns()
        if self._other is not None:
            torque = self._other.step(state).torque
            end = thread_time_ns()
            self.apart.append(float(np.abs(command.torque - torque).max() / np.abs(torque).max()))
        self.ticks.append((between - begin, 0 if self._other is None else end - between))
        return command


def time_ticks(
    walk: hp.scenario.Walk, other: hp.Controller | None = None
) -> tuple[hp.Run, Vector, Vector]:
    """Walk with every tick called from Python, and with another controller that is given the same
    states.

    Returns:
        The run; (ticks, 2) times of both, µs; and (ticks,) how far their torques are apart, as a
        share of the largest torque. Times and shares are without the first ten.
    """
    timed = _Timed(walk.controller, other)
    run = replace(walk, controller=timed).run(
        on_tick=lambda state: None
    )  # or the loop would be compiled as a whole
    return run, 1e-3 * np.array(timed.ticks[FIRST:]), np.array(timed.apart[FIRST:])
