"""Live on the estimate: it walks, and no change tells it where the robot is."""

import numpy as np
import pinocchio as pin
import pytest
from needs import needs_robots

import harpy_pin as hp
from harpy_pin.contrib.live.live_session import PERIOD, LiveSession
from harpy_pin.contrib.live.settings import LiveSettings
from harpy_pin.simulation.sensing import EstimatedState


def walk(session: LiveSession, duration: float) -> LiveSession:
    session.step(round(duration / PERIOD))
    return session


def test_driven_on_the_estimate(robot: hp.Robot) -> None:
    """It walks and turns on what it feels, on a slope, too; the log has the estimate, and it is not
    the truth.
    """
    session = walk(LiveSession(LiveSettings(forward=0.3, friction=0.6), robot=robot), 0.2)
    assert np.isnan(np.asarray(session.signals["estimated_q"])).all()
    session.change({"state": "estimated", "forward": 0.3, "turning": 0.5})
    walk(walk(walk(session, 1.0), 1.0), 1.0)
    off = np.asarray(session.signals["estimated_q"])[:3] - session.last.state.q[:3]
    assert 1e-5 < np.linalg.norm(off) < 0.05
    session.change({"slope": 0.1, "turning": 0.0})
    assert not walk(walk(walk(session, 1.0), 1.0), 1.0).ending
    assert session.plane.slope == 0.1
    session.change({"state": "true"})
    assert np.isnan(np.asarray(session.signals["estimated_q"])).all()
    assert not walk(session, 0.5).ending


def estimator_of(session: LiveSession) -> hp.Estimator:
    """What the controller gets its state from."""
    assert isinstance(session._sensors, EstimatedState)
    return session._sensors.estimator


def headings(session: LiveSession) -> tuple[float, float]:
    """Heading of the robot, and the estimate of it, rad."""
    poses = session.simulator.q, np.asarray(session.signals["estimated_q"])
    true, estimated = (
        float(pin.rpy.matrixToRpy(pin.Quaternion(q[3:7]).matrix())[2]) for q in poses
    )
    return true, estimated


@needs_robots
def test_changes_leave_the_estimate_alone() -> None:
    """Neither slope nor controller nor schedule say where the robot is, and no foot is
    forgotten.
    """
    session = walk(LiveSession(robot=hp.load_robot("go2")), 0.1)
    session.change({"state": "estimated"})
    q = session.simulator.q.copy()
    q[3:7] = (pin.Quaternion(pin.rpy.rpyToMatrix(0.0, 0.0, 0.3)) * pin.Quaternion(q[3:7])).coeffs()
    estimator_of(session).reset(q)
    walk(walk(session, 1.0), 1.0)
    heading, estimated = headings(session)
    assert estimated - heading == pytest.approx(0.3, abs=0.01)
    for change in ({"slope": 0.05}, {"controller": "wbc"}, {"controller": "condensed"}):
        session.change(change)
        walk(session, 0.05)
        assert estimator_of(session).probability.min() > 0.9
    for schedule in ("crawl", "pace", "trot"):
        session.change({"schedule": schedule})
        walk(session, 0.5)
        assert isinstance(session.gait, hp.WalkingGait)
        assert session.gait.schedule == schedule
    true, estimated = headings(session)
    assert estimated - true == pytest.approx(0.3, abs=0.01)
    assert true == pytest.approx(heading, abs=0.05)
