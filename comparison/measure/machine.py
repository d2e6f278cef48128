"""Where the numbers come from."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from harpy_pin.log.run import describe_versions

__all__ = ["describe_all_versions", "describe_machine"]


def describe_machine() -> dict[str, Any]:
    """Processor, cores, operating system, and how busy the machine is already."""
    affinity = getattr(os, "sched_getaffinity", None)
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
    return {
        "cpu": _cpu_model(),
        "cores": os.cpu_count(),
        "usable_cores": len(affinity(0)) if affinity is not None else os.cpu_count(),
        "os": f"{platform.system()} {platform.release()}",
        "architecture": platform.machine(),
        "load_1min": load,
    }


def describe_all_versions() -> dict[str, str]:
    """Versions of everything that decides a number here."""
    versions = describe_versions()
    for name in ("scipy", "daqp"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "not installed"
    return versions


def _cpu_model() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            if line.lower().startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"
