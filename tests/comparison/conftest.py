"""The problems that peers are given."""

import pytest
from peer_cases import CASES, Make

from comparison.peers.peer_problem import Case, PeerProblem, make_problem


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Make:
    """A case and its problem, made once."""
    known: dict[str, tuple[Case, PeerProblem]] = {}

    def make(name: str) -> tuple[Case, PeerProblem]:
        if name not in known:
            case = CASES[name]()
            known[name] = case, make_problem(case, tmp_path_factory.mktemp("model") / "robot.urdf")
        return known[name]

    return make


@pytest.fixture(scope="session")
def problem(made: Make) -> PeerProblem:
    return made("harpy, walks")[1]
