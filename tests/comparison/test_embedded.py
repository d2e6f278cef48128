"""Instructions on a microcontroller: what is counted where DAQP's source cannot be had."""

from __future__ import annotations

import subprocess
from types import SimpleNamespace

from comparison.measure import daqp_c
from comparison.studies import embedded


def test_without_its_source_daqp_is_left_out(monkeypatch, tmp_path):
    def offline(*_, **__):
        raise subprocess.CalledProcessError(1, "pip")

    monkeypatch.setattr(daqp_c.subprocess, "run", offline)
    assert daqp_c.daqp_source(tmp_path) is None
    assert list(tmp_path.iterdir()) == []
    monkeypatch.setattr(embedded, "missing_tools", lambda: None)
    settings = SimpleNamespace(**embedded.STUDY.defaults)
    for here, listed in ((tmp_path, False), (None, True)):
        monkeypatch.setattr(
            embedded, "daqp_source", lambda _, here=here: None if here else tmp_path
        )
        assert any(job["controller"] == "daqp" for job in embedded.STUDY.jobs(settings)) == listed
