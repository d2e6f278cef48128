"""Where the numbers come from."""

from __future__ import annotations

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from harpy_pin.log.run import describe_versions


def describe_machine() -> dict[str, Any]:
    """Processor, cores, operating system, and how busy the machine is already."""
    affinity = getattr(os, "sched_getaffinity", None)
    return {
        "cpu": _cpu_model(),
        "cores": os.cpu_count(),
        "usable_cores": len(affinity(0)) if affinity is not None else os.cpu_count(),
        "os": f"{platform.system()} {platform.release()}",
        "architecture": platform.machine(),
        "load_1min": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
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
    file = Path("/proc/cpuinfo")
    lines = file.read_text(encoding="utf-8", errors="replace").splitlines() if file.exists() else []
    models = [line.partition(":")[2].strip() for line in lines if line.lower().startswith("model name")]
    return models[0] if models else platform.processor() or "unknown"
